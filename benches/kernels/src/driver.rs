//! Compiles compute kernels with RADV and reads its statistics, through Vulkan's `VK_KHR_pipeline_executable_properties`.
#![allow(unsafe_code, reason = "Vulkan is a C interface")]

use std::ffi::CStr;

use ash::{Device, Entry, Instance, khr::pipeline_executable_properties, vk};
use canted_shaders::{BindingKind, Entry as KernelEntry};
use serde::Serialize;

/// What came out of a kernel.
#[derive(Clone, Debug, Default, Serialize)]
pub(crate) struct Compiled {
    instructions: u64,
    /// Vector registers of an invocation, after allocation.
    vgprs: u64,
    spilled_vgprs: u64,
    spilled_sgprs: u64,
    /// Memory that a wave needs for arrays and spilled registers.
    scratch_bytes: u64,
    code_bytes: u64,
}

/// RADV with a device of the forced family.
pub(crate) struct Driver {
    /// Such as `Mesa 22.3.6`.
    pub(crate) version: String,
    device: Device,
    statistics: pipeline_executable_properties::Device,
    instance: Instance,
    /// Unloads the library when it is dropped, so it is last.
    _entry: Entry,
}

impl Driver {
    /// Opens the device, or says what is missing.
    pub(crate) fn open() -> Result<Self, String> {
        // SAFETY: the library that is loaded is the system's Vulkan loader, whose functions have these types.
        let entry =
            unsafe { Entry::load() }.map_err(|_| "the Vulkan loader (libvulkan1) is not installed".to_owned())?;
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_2);
        let info = vk::InstanceCreateInfo::default().application_info(&application);
        // SAFETY: the structures live during the call.
        let instance = unsafe { entry.create_instance(&info, None) };
        let missing = || "Mesa's RADV (mesa-vulkan-drivers) is not installed".to_owned();
        let instance = instance.map_err(|_| missing())?;
        // SAFETY: the instance is valid until it is dropped with `Self`.
        let devices = unsafe { instance.enumerate_physical_devices() }.map_err(|_| missing())?;
        let found = devices.into_iter().find_map(|device| {
            let mut driver = vk::PhysicalDeviceDriverProperties::default();
            let mut properties = vk::PhysicalDeviceProperties2::default().push_next(&mut driver);
            // SAFETY: the device belongs to the instance, and the chain lives during the call.
            unsafe { instance.get_physical_device_properties2(device, &mut properties) };
            let info = text(driver.driver_info_as_c_str().ok());
            (driver.driver_id == vk::DriverId::MESA_RADV).then_some((device, info))
        });
        let Some((physical, info)) = found else { return Err(missing()) };
        let priorities = [1.0];
        let queues = [vk::DeviceQueueCreateInfo::default().queue_family_index(0).queue_priorities(&priorities)];
        let extensions = [pipeline_executable_properties::NAME.as_ptr()];
        let mut feature =
            vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default().pipeline_executable_info(true);
        let info_of_device = vk::DeviceCreateInfo::default()
            .queue_create_infos(&queues)
            .enabled_extension_names(&extensions)
            .push_next(&mut feature);
        // SAFETY: every device has a queue family 0; the structures live during the call.
        let device = unsafe { instance.create_device(physical, &info_of_device, None) };
        let device = device.map_err(|error| format!("this RADV has no statistics of kernels: {error}"))?;
        let statistics = pipeline_executable_properties::Device::new(&instance, &device);
        // Debian's version comes with the name of the package; that of Mesa is the word after it.
        let version = info.split_whitespace().take(2).collect::<Vec<_>>().join(" ");
        Ok(Self { version, device, statistics, instance, _entry: entry })
    }

    /// Compiles the entry point `main` of a module.
    pub(crate) fn compile(&self, words: &[u32], entry: &KernelEntry) -> Result<Compiled, vk::Result> {
        let mut made = Made { device: &self.device, sets: vec![], layout: None, module: None, pipeline: None };
        let n_groups = entry.bindings.iter().map(|binding| binding.group + 1).max().unwrap_or(0);
        for group in 0..n_groups {
            let own = entry.bindings.iter().filter(|binding| binding.group == group);
            let list: Vec<_> = own
                .map(|binding| {
                    let kind = match binding.kind {
                        BindingKind::Uniform => vk::DescriptorType::UNIFORM_BUFFER,
                        BindingKind::Storage { .. } => vk::DescriptorType::STORAGE_BUFFER,
                        BindingKind::Texture => vk::DescriptorType::SAMPLED_IMAGE,
                        BindingKind::Sampler => vk::DescriptorType::SAMPLER,
                        BindingKind::AccelerationStructure => vk::DescriptorType::ACCELERATION_STRUCTURE_KHR,
                    };
                    vk::DescriptorSetLayoutBinding::default()
                        .binding(binding.number)
                        .descriptor_type(kind)
                        .descriptor_count(1)
                        .stage_flags(vk::ShaderStageFlags::COMPUTE)
                })
                .collect();
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&list);
            // SAFETY: the device is valid, and the list lives during the call.
            made.sets.push(unsafe { self.device.create_descriptor_set_layout(&info, None) }?);
        }
        let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&made.sets);
        // SAFETY: as above; the sets are destroyed with `made`.
        let layout = unsafe { self.device.create_pipeline_layout(&info, None) }?;
        made.layout = Some(layout);
        let info = vk::ShaderModuleCreateInfo::default().code(words);
        // SAFETY: the module is valid SPIR-V, which naga wrote.
        let module = unsafe { self.device.create_shader_module(&info, None) }?;
        made.module = Some(module);
        let stage = vk::PipelineShaderStageCreateInfo::default()
            .stage(vk::ShaderStageFlags::COMPUTE)
            .module(module)
            .name(c"main");
        let info = vk::ComputePipelineCreateInfo::default()
            .stage(stage)
            .layout(layout)
            .flags(vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR);
        // SAFETY: layout and module fit each other, because both come from the same entry point.
        let pipelines = unsafe { self.device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None) };
        let pipeline = pipelines.map_err(|(_, error)| error)?[0];
        made.pipeline = Some(pipeline);
        let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline).executable_index(0);
        // SAFETY: the pipeline was created with statistics, and a compute pipeline has one executable.
        let list = unsafe { self.statistics.get_pipeline_executable_statistics(&info) }?;
        Ok(compiled(&list))
    }
}

impl Drop for Driver {
    fn drop(&mut self) {
        // SAFETY: nothing that was created on them is left.
        unsafe {
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}

/// What a compilation created, destroyed at its end.
struct Made<'a> {
    device: &'a Device,
    sets: Vec<vk::DescriptorSetLayout>,
    layout: Option<vk::PipelineLayout>,
    module: Option<vk::ShaderModule>,
    pipeline: Option<vk::Pipeline>,
}

impl Drop for Made<'_> {
    fn drop(&mut self) {
        // SAFETY: all belong to the device and are not used any more; a null handle is ignored.
        unsafe {
            self.device.destroy_pipeline(self.pipeline.unwrap_or_default(), None);
            self.device.destroy_shader_module(self.module.unwrap_or_default(), None);
            self.device.destroy_pipeline_layout(self.layout.unwrap_or_default(), None);
            self.sets.iter().for_each(|&set| self.device.destroy_descriptor_set_layout(set, None));
        }
    }
}

/// The statistics that the table has, by RADV's names.
fn compiled(list: &[vk::PipelineExecutableStatisticKHR<'_>]) -> Compiled {
    let mut found = Compiled::default();
    for statistic in list {
        let into = match &*text(statistic.name_as_c_str().ok()) {
            "Instructions" => &mut found.instructions,
            "VGPRs" => &mut found.vgprs,
            "Spilled VGPRs" => &mut found.spilled_vgprs,
            "Spilled SGPRs" => &mut found.spilled_sgprs,
            "Scratch size" => &mut found.scratch_bytes,
            "Code size" => &mut found.code_bytes,
            _ => continue,
        };
        if statistic.format == vk::PipelineExecutableStatisticFormatKHR::UINT64 {
            // SAFETY: the format says which member is set.
            *into = unsafe { statistic.value.u64 };
        }
    }
    found
}

fn text(name: Option<&CStr>) -> String {
    name.unwrap_or_default().to_string_lossy().into_owned()
}
