//! A device with the experimental ray queries of `wgpu`.
#![expect(unsafe_code, reason = "experimental features are enabled by an unsafe call")]

use canted_gpu::wgpu::{Adapter, Device, DeviceDescriptor, ExperimentalFeatures, Features, Queue, RequestDeviceError};

/// Whether an adapter has ray queries.
#[must_use]
pub fn has_ray_queries(adapter: &Adapter) -> bool {
    adapter.features().contains(Features::EXPERIMENTAL_RAY_QUERY)
}

/// Opens an adapter with ray queries, and timestamps where it has them.
///
/// # Errors
/// The adapter provides no such device.
pub async fn open(adapter: &Adapter) -> Result<(Device, Queue), RequestDeviceError> {
    let all = Features::EXPERIMENTAL_RAY_QUERY | Features::TIMESTAMP_QUERY;
    // SAFETY: these features have no contract that this program could break; known bugs concern what it does not do, such as
    // destroying acceleration structures while they are in use.
    let experimental_features = unsafe { ExperimentalFeatures::enabled() };
    let descriptor = DeviceDescriptor {
        label: Some("ray queries"),
        required_features: adapter.features() & all,
        required_limits: adapter.limits(),
        experimental_features,
        ..DeviceDescriptor::default()
    };
    adapter.request_device(&descriptor).await
}
