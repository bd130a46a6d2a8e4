//! How the answers of the device differ from the CPU's.

use canted_gpu::{DeviceHit, Outcome};
use canted_obb::PrimId;
use canted_trace::{Hit, InstanceId, Side};

/// Counts over all rays.
#[derive(Default)]
pub(crate) struct Differences {
    /// Rays that hit on the CPU.
    pub(crate) hits: u32,
    /// Rays that hit on one side alone.
    pub(crate) one_side: u32,
    /// Rays with another triangle.
    pub(crate) triangle: u32,
    /// The greatest difference of `t`, relative to it.
    pub(crate) distance: f32,
    /// Rays that the device did not finish.
    pub(crate) incomplete: u32,
}

impl Differences {
    /// Compares closest hits.
    pub(crate) fn of_hits(device: &[Outcome<Option<DeviceHit>>], cpu: &[Option<Hit>]) -> Self {
        let mut differences = Self::default();
        for (device, cpu) in device.iter().zip(cpu) {
            differences.hits += u32::from(cpu.is_some());
            match (device, cpu) {
                (Outcome::Incomplete, _) => differences.incomplete += 1,
                (Outcome::Complete(None), None) => {}
                (Outcome::Complete(Some(device)), Some(cpu)) => {
                    let is_same = [device.instance, device.primitive] == [cpu.instance.0, cpu.primitive.0];
                    differences.triangle += u32::from(!is_same);
                    differences.distance = differences.distance.max((device.t - cpu.t).abs() / cpu.t);
                }
                _ => differences.one_side += 1,
            }
        }
        differences
    }

    /// Compares occlusion.
    pub(crate) fn of_occlusion(device: &[Outcome<bool>], cpu: &[bool]) -> Self {
        let mut differences = Self::default();
        for (device, &cpu) in device.iter().zip(cpu) {
            differences.hits += u32::from(cpu);
            match device {
                Outcome::Incomplete => differences.incomplete += 1,
                Outcome::Complete(device) => differences.one_side += u32::from(*device != cpu),
            }
        }
        differences
    }
}

/// The device's hits in the form of the CPU's. The picture has no use for sides.
pub(crate) fn hits_of(device: &[Outcome<Option<DeviceHit>>]) -> Vec<Option<Hit>> {
    let hit = |outcome: &Outcome<Option<DeviceHit>>| match *outcome {
        Outcome::Complete(Some(DeviceHit { t, u, v, primitive, instance })) => {
            Some(Hit { t, u, v, primitive: PrimId(primitive), instance: InstanceId(instance), side: Side::Front })
        }
        _ => None,
    };
    device.iter().map(hit).collect()
}

/// A checksum (FNV-1a) of instances and primitives of all hits.
pub(crate) fn checksum(hits: &[Option<Hit>]) -> u32 {
    let words = hits.iter().flat_map(|hit| hit.map_or([u32::MAX; 2], |hit| [hit.instance.0, hit.primitive.0]));
    words.flat_map(u32::to_le_bytes).fold(0x811c_9dc5, |sum, byte| (sum ^ u32::from(byte)).wrapping_mul(0x0100_0193))
}
