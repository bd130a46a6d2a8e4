//! Devices, buffers and dispatches.

use crate::common::{gpu, lowered};
use canted_gpu::{GpuError, Variant, loop_iterations};

#[test]
fn buffers_read_back_unchanged() {
    let Some(gpu) = gpu("buffers_read_back_unchanged") else { return };
    for n in [0_u32, 1, 3, 1000] {
        let values: Vec<u32> = (0..n).collect();
        assert_eq!(gpu.read(&gpu.buffer("values", &values).unwrap()).unwrap(), values);
    }
}

#[test]
fn a_kernel_runs_and_is_timed() {
    let Some(gpu) = gpu("a_kernel_runs_and_is_timed") else { return };
    assert_eq!(loop_iterations(&gpu, 1000).unwrap(), 1000);
    let kernel = gpu.kernel("check/loops", &Variant::none()).unwrap();
    let wanted = gpu.uniform("wanted", &[7_u32, 0, 0, 0]).unwrap();
    let counted = gpu.zeroed::<u32>("counted", 5000).unwrap();
    let mut commands = gpu.timed_commands();
    commands.dispatch(&kernel, &[("wanted", &wanted), ("counted", &counted)], kernel.groups(5000)).unwrap();
    let times = commands.times().unwrap();
    assert_eq!(times.len(), usize::from(gpu.has_timestamps()));
    assert!(gpu.read(&counted).unwrap().iter().all(|&turns| turns == 7));
}

#[test]
fn a_missing_binding_is_reported() {
    let Some(gpu) = gpu("a_missing_binding_is_reported") else { return };
    let kernel = gpu.kernel("check/loops", &Variant::none()).unwrap();
    let counted = gpu.zeroed::<u32>("counted", 1).unwrap();
    let error = gpu.commands().dispatch(&kernel, &[("counted", &counted)], [1, 1, 1]).unwrap_err().to_string();
    assert!(error.contains("kernel 'check/loops' has no binding for 'wanted'"), "{error}");
}

#[test]
fn exceeding_a_limit_is_reported_with_a_remedy() {
    let Some(gpu) = lowered("exceeding_a_limit_is_reported_with_a_remedy", 1 << 20) else { return };
    let error = gpu.zeroed::<u32>("the nodes", 1 << 20).err().expect("4 MiB do not fit in 1 MiB").to_string();
    assert_eq!(
        error,
        "the nodes: requires 4194304 bytes in a storage binding, the device supports 1048576; use a smaller scene"
    );
}

#[test]
fn a_lost_device_stays_lost() {
    let Some(gpu) = gpu("a_lost_device_stays_lost") else { return };
    let buffer = gpu.buffer("values", &[1_u32, 2]).unwrap();
    gpu.lose();
    for _ in 0..2 {
        assert!(matches!(gpu.read(&buffer), Err(GpuError::Lost { .. })));
        assert!(matches!(gpu.zeroed::<u32>("more", 4).err(), Some(GpuError::Lost { .. })));
    }
}

#[test]
fn exceeding_the_memory_limit_is_an_error_until_buffers_are_dropped() {
    let Some(gpu) = gpu("exceeding_the_memory_limit_is_an_error_until_buffers_are_dropped") else { return };
    gpu.limit_memory(1 << 20);
    let first = gpu.zeroed::<u32>("nodes", 1 << 17).unwrap();
    let sentence = "out of device memory for triangles of 786432 bytes; use a smaller scene";
    let refused = gpu.zeroed::<u32>("triangles", 3 << 16).map(drop).unwrap_err();
    assert_eq!(refused.to_string(), sentence);
    drop(first);
    let second = gpu.zeroed::<u32>("triangles", 3 << 16).unwrap();
    assert_eq!(gpu.read(&second).unwrap().len(), 3 << 16);
}
