//! Bindings and layouts of a kernel, from `naga`.

use naga::{
    AddressSpace, Module, StorageAccess, TypeInner,
    valid::{Capabilities, ModuleInfo, ValidationFlags, Validator},
};

use crate::{ShaderError, ShaderName, Variant, assemble};

/// Maximum number of storage buffers of a stage over all kernels: the limit that hosts request.
pub const MAX_STORAGE_BUFFERS: u32 = 31;

/// Line of kernels that use ray queries of the driver.
const RAY_QUERIES: &str = "enable wgpu_ray_query;";

/// An assembled and validated kernel.
#[derive(Clone, Debug)]
pub struct Shader {
    /// Its name.
    pub name: String,
    /// WGSL with all parts.
    pub source: String,
    /// Values of the overrides.
    pub overrides: Vec<(&'static str, f64)>,
    /// Its entry points, in order.
    pub entries: Vec<Entry>,
    /// Its structures.
    pub layouts: Vec<Layout>,
}

/// An entry point of a kernel.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Entry {
    /// Name of the function.
    pub name: String,
    /// Its stage.
    pub stage: ShaderStage,
    /// Invocations of a work-group along each axis; zero for other stages.
    pub workgroup_size: [u32; 3],
    /// Work-group memory in bytes.
    pub workgroup_bytes: u32,
    /// Its bindings, by group and index.
    pub bindings: Vec<Binding>,
}

/// Shader stages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ShaderStage {
    /// Compute.
    Compute,
    /// Vertex stage of a raster pass.
    Vertex,
    /// Fragment stage of a raster pass.
    Fragment,
}

/// A resource that an entry point uses.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Binding {
    /// Index of the bind group.
    pub group: u32,
    /// Index in the group.
    pub number: u32,
    /// Name of the variable.
    pub name: String,
    /// Kind of resource.
    pub kind: BindingKind,
    /// Size of the fixed part, plus one element of a runtime-sized array, in bytes.
    pub least_bytes: u32,
}

/// Kinds of resources.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BindingKind {
    /// Uniform buffer.
    Uniform,
    /// Storage buffer.
    Storage {
        /// Whether the kernel writes to it.
        writes: bool,
    },
    /// Texture, sampled or storage.
    Texture,
    /// Sampler.
    Sampler,
    /// An acceleration structure of the driver.
    AccelerationStructure,
}

/// Memory layout of a structure.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Layout {
    /// Its name.
    pub name: String,
    /// Name and offset in bytes of each member.
    pub members: Vec<(String, u32)>,
    /// Size in bytes, with padding.
    pub size: u32,
}

impl Shader {
    /// Assembles and validates kernel `name`.
    ///
    /// # Errors
    /// The errors of [`assemble`], invalid WGSL, or an override that is unknown or has no value.
    pub fn new(name: ShaderName, chosen: &Variant) -> Result<Self, ShaderError> {
        let source = assemble(name, chosen)?;
        let (module, info) = specialized(name.as_str(), &source, chosen.overrides())?;
        let entries = (0..module.entry_points.len()).map(|index| entry(&module, &info, index)).collect();
        let layouts = module.types.iter().filter_map(|(_, ty)| layout(ty)).collect();
        Ok(Self { name: name.to_string(), source, overrides: chosen.overrides().to_vec(), entries, layouts })
    }

    /// The kernel as words of SPIR-V, for a driver without `wgpu`. Loops are bounded as `wgpu` bounds them; indices are not checked.
    ///
    /// # Errors
    /// A kernel that SPIR-V cannot express.
    pub fn spirv(&self) -> Result<Vec<u32>, ShaderError> {
        let (module, info) = specialized(&self.name, &self.source, &self.overrides)?;
        // The version that every Vulkan 1.2 takes.
        let options = naga::back::spv::Options { lang_version: (1, 3), ..Default::default() };
        naga::back::spv::write_vec(&module, &info, &options, None)
            .map_err(|error| ShaderError::Invalid { kernel: self.name.clone(), message: error.to_string() })
    }

    /// The entry point of this name.
    #[must_use]
    pub fn entry(&self, name: &str) -> Option<&Entry> {
        self.entries.iter().find(|entry| entry.name == name)
    }

    /// The structure of this name.
    #[must_use]
    pub fn layout(&self, name: &str) -> Option<&Layout> {
        self.layouts.iter().find(|layout| layout.name == name)
    }
}

/// The module of a text with values for its overrides.
pub(crate) fn specialized(
    name: &str,
    source: &str,
    overrides: &[(&'static str, f64)],
) -> Result<(Module, ModuleInfo), ShaderError> {
    let invalid = |message: String| ShaderError::Invalid { kernel: name.to_owned(), message };
    let module = naga::front::wgsl::parse_str(source).map_err(|error| invalid(error.emit_to_string(source)))?;
    for (known, _) in overrides {
        if !module.overrides.iter().any(|(_, o)| o.name.as_deref() == Some(known)) {
            return Err(ShaderError::UnknownChoice { kernel: name.to_owned(), what: (*known).to_owned() });
        }
    }
    // No optional capabilities, but for kernels that say so: others that need one fail here rather than on another machine.
    let asks = source.lines().any(|line| line == RAY_QUERIES);
    let capabilities = if asks { Capabilities::RAY_QUERY } else { Capabilities::empty() };
    let mut validator = Validator::new(ValidationFlags::all(), capabilities);
    let info = validator.validate(&module).map_err(|error| invalid(error.emit_to_string(source)))?;
    let values = overrides.iter().map(|(name, value)| ((*name).to_owned(), *value)).collect();
    let (module, info) = naga::back::pipeline_constants::process_overrides(&module, &info, None, &values)
        .map_err(|error| invalid(error.to_string()))?;
    Ok((module.into_owned(), info.into_owned()))
}

fn entry(module: &Module, info: &ModuleInfo, index: usize) -> Entry {
    let point = &module.entry_points[index];
    let used = info.get_entry_point(index);
    let mut bindings = vec![];
    let mut workgroup_bytes = 0;
    for (handle, variable) in module.global_variables.iter().filter(|(handle, _)| !used[*handle].is_empty()) {
        let size = module.types[variable.ty].inner.size(module.to_ctx());
        if variable.space == AddressSpace::WorkGroup {
            workgroup_bytes += size.next_multiple_of(16);
        }
        let Some(place) = &variable.binding else { continue };
        bindings.push(Binding {
            group: place.group,
            number: place.binding,
            name: variable.name.clone().unwrap_or_default(),
            kind: kind(&module.types[variable.ty].inner, variable.space, used[handle]),
            least_bytes: size,
        });
    }
    bindings.sort_by_key(|binding| (binding.group, binding.number));
    Entry {
        name: point.name.clone(),
        stage: match point.stage {
            naga::ShaderStage::Vertex => ShaderStage::Vertex,
            naga::ShaderStage::Fragment => ShaderStage::Fragment,
            _ => ShaderStage::Compute,
        },
        workgroup_size: point.workgroup_size,
        workgroup_bytes,
        bindings,
    }
}

fn kind(inner: &TypeInner, space: AddressSpace, used: naga::valid::GlobalUse) -> BindingKind {
    match (inner, space) {
        (TypeInner::Sampler { .. }, _) => BindingKind::Sampler,
        (TypeInner::AccelerationStructure { .. }, _) => BindingKind::AccelerationStructure,
        (TypeInner::Image { .. }, _) => BindingKind::Texture,
        (_, AddressSpace::Uniform) => BindingKind::Uniform,
        (_, AddressSpace::Storage { access }) => BindingKind::Storage {
            // The bind group layout follows from the declaration, whatever the kernel does.
            writes: access.contains(StorageAccess::STORE) || used.contains(naga::valid::GlobalUse::WRITE),
        },
        _ => BindingKind::Uniform,
    }
}

fn layout(ty: &naga::Type) -> Option<Layout> {
    let TypeInner::Struct { members, span } = &ty.inner else { return None };
    let members = members.iter().map(|member| (member.name.clone().unwrap_or_default(), member.offset)).collect();
    Some(Layout { name: ty.name.clone()?, members, size: *span })
}

/// Asserts that a Rust structure has the members and offsets of the kernel's structure of that name.
#[doc(hidden)]
#[macro_export]
macro_rules! same_layout {
    ($kernel:expr, $chosen:expr, $name:literal, $ty:ty { $($member:ident),* $(,)? }) => {{
        let shader = $crate::Shader::new($kernel, $chosen).unwrap();
        let layout = shader.layout($name).unwrap();
        let members = [$((stringify!($member).to_owned(), std::mem::offset_of!($ty, $member))),*];
        let found: Vec<(String, usize)> = layout.members.iter().map(|(name, at)| (name.clone(), *at as usize)).collect();
        assert_eq!((found.as_slice(), layout.size as usize), (members.as_slice(), size_of::<$ty>()));
    }};
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::wgsl;

    #[test]
    fn reflection_lists_bindings() {
        let shader = Shader::new(wgsl::check::LOOPS, &Variant::none()).unwrap();
        let main = shader.entry("main").unwrap();
        assert_eq!(main.workgroup_size, [64, 1, 1]);
        let bindings: Vec<_> = main.bindings.iter().map(|b| (b.number, b.name.as_str(), b.kind)).collect();
        assert_eq!(
            bindings,
            [(0, "wanted", BindingKind::Uniform), (1, "counted", BindingKind::Storage { writes: true })]
        );
    }

    #[test]
    fn invalid_wgsl_is_reported_with_its_location() {
        let error = specialized("x", "fn f() -> u32 { return 1.5; }", &[]).unwrap_err().to_string();
        assert!(error.starts_with("kernel 'x' is not valid") && error.contains("1.5"), "{error}");
    }

    #[test]
    fn overrides_may_size_work_group_memory() {
        let text = "override N: u32 = 4u; var<workgroup> shared_words: array<u32, N>;
            @compute @workgroup_size(N) fn main(@builtin(local_invocation_index) i: u32) { shared_words[i] = i; }";
        let (module, info) = specialized("x", text, &[("N", 64.0)]).unwrap();
        let entry = entry(&module, &info, 0);
        assert_eq!((entry.workgroup_size, entry.workgroup_bytes), ([64, 1, 1], 256));
        let error = specialized("x", text, &[("M", 1.0)]).unwrap_err();
        assert_eq!(error.to_string(), "kernel 'x' has no slot or constant 'M'");
    }
}
