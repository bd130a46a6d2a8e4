//! Devices, buffers and dispatches.

use canted_fixtures::device_tests::{Test, needs_device};
use canted_gpu::{GpuError, Traffic, Variant, block_on, loop_iterations, wgsl};

use crate::{gpu, lowered};

pub(crate) fn tests() -> Vec<Test> {
    vec![
        needs_device(only_changed_parts_are_uploaded),
        needs_device(buffers_read_back_unchanged),
        needs_device(several_buffers_come_in_one_read),
        needs_device(work_buffers_serve_again_within_the_limits),
        needs_device(a_kernel_runs_and_is_timed),
        needs_device(a_missing_binding_is_reported),
        needs_device(exceeding_a_limit_is_reported_with_a_remedy),
        needs_device(a_lost_device_stays_lost),
        needs_device(exceeding_the_memory_limit_is_an_error_until_buffers_are_dropped),
    ]
}

fn buffers_read_back_unchanged() {
    let gpu = gpu();
    for n in [0_u32, 1, 3, 1000] {
        let values: Vec<u32> = (0..n).collect();
        assert_eq!(block_on(gpu.read(&gpu.buffer("values", &values).unwrap())).unwrap(), values);
    }
}

/// Also where the values come in several pieces, or where there are none.
fn several_buffers_come_in_one_read() {
    let gpu = gpu();
    let counts = [gpu.buffer("counts", &[1_u32, 2, 3]).unwrap(), gpu.buffer("counts", &[4_u32]).unwrap()];
    for n in [0_u32, 5, 5 << 20] {
        let values: Vec<u32> = (0..n).collect();
        let there = gpu.buffer("values", &values).unwrap();
        let before = gpu.traffic();
        let beside = [(&counts[0], 2), (&counts[1], 9)];
        assert!(
            block_on(gpu.read_beside(&there, values.len(), &beside)).unwrap() == (values, vec![1, 2, 4]),
            "{n} values"
        );
        let Traffic { n_downloads, downloaded_bytes, .. } = gpu.traffic() - before;
        assert_eq!((n_downloads, downloaded_bytes), (1, 4 * u64::from(n) + 12));
    }
}

fn work_buffers_serve_again_within_the_limits() {
    let gpu = lowered(1 << 16);
    let of = |len: usize| gpu.work_buffer::<u32>("rays", len);
    let first = of(1000).unwrap();
    let memory = first.wgpu().clone();
    // It is in use, or has another name.
    assert!(*of(10).unwrap().wgpu() != memory);
    assert!(*gpu.work_buffer::<u32>("hits", 1000).unwrap().wgpu() != memory);
    drop(first);
    // A smaller one has the size that was asked for.
    let second = of(900).unwrap();
    assert!(*second.wgpu() == memory && second.len() == 900 && second.n_bytes() == 3600);
    drop(second);
    // A much larger one is left alone.
    let large = of(1 << 14).unwrap().wgpu().clone();
    assert!(*of(100).unwrap().wgpu() != large);
    gpu.free_work_buffers();
    assert!(*of(1001).unwrap().wgpu() != memory);
    // The limit of a binding holds, and that of the memory: what nothing uses is freed, what is in use is not.
    assert!(matches!(of((1 << 14) + 1), Err(GpuError::Limit { .. })));
    gpu.free_work_buffers();
    let kept = of(1 << 14).unwrap();
    drop(of(1 << 14).unwrap());
    gpu.limit_memory(5 << 15);
    let other = gpu.zeroed::<u32>("other", 1 << 14).unwrap();
    assert!(matches!(of(1 << 14), Err(GpuError::OutOfMemory { .. })));
    drop((kept, other));
    gpu.limit_memory(1 << 15);
    assert!(matches!(of(1 << 14), Err(GpuError::OutOfMemory { .. })));
    drop(of(1 << 13).unwrap());
    assert!(gpu.free_work_buffers());
    assert!(!gpu.free_work_buffers());
}

fn a_kernel_runs_and_is_timed() {
    let gpu = gpu();
    assert_eq!(block_on(loop_iterations(&gpu, 1000)).unwrap(), 1000);
    let kernel = gpu.kernel(wgsl::check::LOOPS, &Variant::none()).unwrap();
    let wanted = gpu.uniform("wanted", &[7_u32, 0, 0, 0]).unwrap();
    let counted = gpu.zeroed::<u32>("counted", 5000).unwrap();
    let mut commands = gpu.timed_commands();
    commands.dispatch(&kernel, &[("wanted", &wanted), ("counted", &counted)], kernel.groups(5000)).unwrap();
    let times = block_on(commands.times()).unwrap();
    assert_eq!(times.len(), usize::from(gpu.has_timestamps()));
    assert!(block_on(gpu.read(&counted)).unwrap().iter().all(|&turns| turns == 7));
}

fn a_missing_binding_is_reported() {
    let gpu = gpu();
    let kernel = gpu.kernel(wgsl::check::LOOPS, &Variant::none()).unwrap();
    let counted = gpu.zeroed::<u32>("counted", 1).unwrap();
    let error = gpu.commands().dispatch(&kernel, &[("counted", &counted)], [1, 1, 1]).unwrap_err().to_string();
    assert!(error.contains("kernel 'check/loops' has no binding for 'wanted'"), "{error}");
}

fn exceeding_a_limit_is_reported_with_a_remedy() {
    let gpu = lowered(1 << 20);
    let error = gpu.zeroed::<u32>("the nodes", 1 << 20).err().expect("4 MiB do not fit in 1 MiB").to_string();
    assert_eq!(
        error,
        "the nodes: requires 4194304 bytes in a storage binding, the device supports 1048576; use a smaller scene"
    );
}

fn a_lost_device_stays_lost() {
    let gpu = gpu();
    let buffer = gpu.buffer("values", &[1_u32, 2]).unwrap();
    gpu.lose();
    for _ in 0..2 {
        assert!(matches!(block_on(gpu.read(&buffer)), Err(GpuError::Lost { .. })));
        assert!(matches!(gpu.zeroed::<u32>("more", 4).err(), Some(GpuError::Lost { .. })));
    }
}

fn exceeding_the_memory_limit_is_an_error_until_buffers_are_dropped() {
    let gpu = gpu();
    gpu.limit_memory(1 << 20);
    let first = gpu.zeroed::<u32>("nodes", 1 << 17).unwrap();
    let sentence = "out of device memory for triangles of 786432 bytes; use a smaller scene";
    let refused = gpu.zeroed::<u32>("triangles", 3 << 16).map(drop).unwrap_err();
    assert_eq!(refused.to_string(), sentence);
    drop(first);
    let second = gpu.zeroed::<u32>("triangles", 3 << 16).unwrap();
    assert_eq!(block_on(gpu.read(&second)).unwrap().len(), 3 << 16);
}

fn only_changed_parts_are_uploaded() {
    let gpu = gpu();
    let uploaded = |values: &[u32]| {
        gpu.start_frame();
        let before = gpu.traffic();
        let buffer = gpu.read_only("values", values).unwrap();
        let Traffic { uploaded_bytes, .. } = gpu.traffic() - before;
        assert_eq!(block_on(gpu.read(&buffer)).unwrap(), values);
        uploaded_bytes
    };
    let mut values: Vec<u32> = (0..1000).collect();
    assert_eq!(uploaded(&values), 4000);
    assert_eq!(uploaded(&values), 0);
    values[70] = 5;
    assert_eq!(uploaded(&values), 256);
    values[999] = 5;
    assert_eq!(uploaded(&values), 4000 - 15 * 256);
    values.push(1);
    assert_eq!(uploaded(&values), 4004);
    // A buffer that is still in use is not overwritten.
    gpu.start_frame();
    let first = gpu.read_only("values", &values).unwrap();
    let second = gpu.read_only("values", &[3_u32; 1001]).unwrap();
    gpu.start_frame();
    let third = gpu.read_only("values", &[4_u32; 1001]).unwrap();
    assert_eq!(block_on(gpu.read(&first)).unwrap(), values);
    assert_eq!(
        [block_on(gpu.read(&second)).unwrap(), block_on(gpu.read(&third)).unwrap()],
        [vec![3; 1001], vec![4; 1001]]
    );
}
