//! Every kernel with every choice for its slots: valid, free of lint findings, within the limits of every device.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use canted_shaders::{
    BindingKind, MAX_STORAGE_BUFFERS, MODULE_BUFFERS, ModuleOptions, Shader, ShaderName, ShaderStage, Variant, choice,
    driver_module, kernels, lint, traversal_module, variants, wgsl,
};

/// Limits that every device supports: the defaults of WebGPU, except for storage buffers.
const MAX_INVOCATIONS: u32 = 256;
const MAX_WORKGROUP_BYTES: u32 = 16_384;

/// Choices for a kernel: each part of each slot is in one.
fn choices(kernel: ShaderName) -> Vec<Variant> {
    variants(kernel).unwrap_or_else(|error| panic!("{error}"))
}

/// A kernel, and what it is with each of its choices.
type Shaders = (ShaderName, Vec<(Variant, Shader)>);

/// Every kernel with each of its choices, assembled and validated once for all tests.
static SHADERS: LazyLock<Vec<Shaders>> = LazyLock::new(|| {
    let shader = |kernel, chosen: &Variant| Shader::new(kernel, chosen).unwrap_or_else(|error| panic!("{error}"));
    let all = |kernel| choices(kernel).into_iter().map(|chosen| (chosen.clone(), shader(kernel, &chosen))).collect();
    kernels().map(|kernel| (kernel, all(kernel))).collect()
});

#[test]
fn every_kernel_is_valid_and_within_the_limits_of_every_device() {
    for (kernel, shaders) in &*SHADERS {
        assert!(!shaders.is_empty(), "{kernel}");
        for (_, shader) in shaders {
            assert!(!shader.entries.is_empty(), "{kernel} has no entry point");
            for entry in &shader.entries {
                let is_compute = entry.stage == ShaderStage::Compute;
                assert_eq!(is_compute, entry.name == "main", "{kernel}: wrong name {} for its stage", entry.name);
                let invocations: u32 = entry.workgroup_size.iter().product();
                assert!(invocations <= MAX_INVOCATIONS, "{kernel}: {invocations} invocations");
                let workgroup_bytes = entry.workgroup_bytes;
                assert!(
                    workgroup_bytes <= MAX_WORKGROUP_BYTES,
                    "{kernel}: {workgroup_bytes} bytes of work-group memory"
                );
                let is_storage = |kind: &BindingKind| matches!(kind, BindingKind::Storage { .. });
                let n_storage = entry.bindings.iter().filter(|binding| is_storage(&binding.kind)).count();
                assert!(n_storage <= MAX_STORAGE_BUFFERS as usize, "{kernel}: {n_storage} storage buffers");
                let mut names: Vec<_> = entry.bindings.iter().map(|binding| &binding.name).collect();
                names.sort();
                names.dedup();
                assert_eq!(names.len(), entry.bindings.len(), "{kernel}: two bindings with the same name");
            }
        }
    }
}

/// Whatever parts fill its slots: each place of a buffer counts once, as no variant binds two buffers at one.
#[test]
fn no_kernel_has_places_for_more_storage_buffers_than_hosts_request() {
    let is_storage = |kind: &BindingKind| matches!(kind, BindingKind::Storage { .. });
    let n_places = |(_, shaders): &Shaders| {
        let entries = shaders.iter().flat_map(|(_, shader)| &shader.entries);
        let bound = entries.flat_map(|entry| &entry.bindings).filter(|binding| is_storage(&binding.kind));
        bound.map(|binding| (binding.group, binding.number)).collect::<BTreeSet<_>>().len()
    };
    assert_eq!(SHADERS.iter().map(n_places).max(), Some(MAX_STORAGE_BUFFERS as usize));
}

#[test]
fn light_in_parts_is_bound_only_where_it_is_kept() {
    use wgsl::render::{HYBRID, PATH, stream};
    let keep = [HYBRID, PATH, stream::START, stream::SHADE, stream::REST];
    assert_eq!(SHADERS.iter().filter(|(kernel, _)| keep.contains(kernel)).count(), keep.len());
    for (kernel, shaders) in SHADERS.iter().filter(|(kernel, _)| keep.contains(kernel)) {
        let mut n_kept = [0; 2];
        for (chosen, shader) in shaders {
            let binds = |name| shader.entries.iter().flat_map(|entry| &entry.bindings).any(|bound| bound.name == name);
            let are_kept = [chosen.has(choice::Components::Three), chosen.has(choice::FirstLight::Four)];
            assert_eq!([binds("components"), binds("first_light")], are_kept, "{kernel}: {chosen:?}");
            n_kept = std::array::from_fn(|k| n_kept[k] + u32::from(are_kept[k]));
        }
        assert_eq!(n_kept.map(|n| n > 0), [true, *kernel != PATH], "{kernel}");
    }
}

/// Storage buffers of a kernel.
fn n_storage(kernel: ShaderName, chosen: &Variant) -> usize {
    let shader = Shader::new(kernel, chosen).unwrap_or_else(|error| panic!("{error}"));
    let is_storage = |kind: &BindingKind| matches!(kind, BindingKind::Storage { .. });
    shader.entries[0].bindings.iter().filter(|binding| is_storage(&binding.kind)).count()
}

/// So a device that shades streams also ends them.
#[test]
fn the_kernel_that_ends_streams_binds_no_more_buffers_than_the_one_that_shades_them() {
    for chosen in choices(wgsl::render::stream::REST) {
        let shade = chosen.of_kernel(wgsl::render::stream::SHADE).unwrap_or_else(|error| panic!("{error}"));
        let [rest, shade] = [(wgsl::render::stream::REST, &chosen), (wgsl::render::stream::SHADE, &shade)]
            .map(|(kernel, chosen)| n_storage(kernel, chosen));
        assert!(rest <= shade, "{rest} and {shade} of {chosen:?}");
    }
}

/// A user's kernel with names that the module also has inside.
const USER: &str = "
struct Node { near: f32 }
@group(0) @binding(0) var<storage, read> nodes: array<Ray>;
@group(0) @binding(1) var<storage, read_write> answers: array<vec4<f32>>;
fn greatest(x: f32) -> f32 { return x; }
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let space = Node(1.0);
    let hit = closest_hit(nodes[id.x]);
    let surface = surface_of(hit, nodes[id.x]);
    let origin = origin_beside(hit, nodes[id.x], normal_of(hit) + surface.position * surface.error);
    let is_dark = occluded(ray(origin, surface.normal, 1.0)) || is_incomplete || surface.is_front;
    answers[id.x] = vec4<f32>(greatest(hit.t), hit.u, f32(hit.instance == NONE), select(space.near, 0.0, is_dark));
}
";

/// The choices for a module, which has its own mask.
fn without_mask(chosen: &Variant) -> Variant {
    chosen.clone().without::<choice::Mask>()
}

/// Tables of a structure, with some lengths.
fn tables(chosen: &Variant) -> Vec<(&'static str, u32)> {
    let above: &[(&str, u32)] = if chosen.has(choice::Level::Single) {
        &[]
    } else if chosen.has(choice::Level::Flat) {
        &[("first_triangles", 3)]
    } else if chosen.has(choice::Level::Instances) {
        &[("instances", 5), ("instance_order", 4)]
    } else {
        &[("instances", 5), ("instance_order", 4), ("motions", 1)]
    };
    [&[("bvhs", 2)], above].concat()
}

#[test]
fn a_kernel_includes_the_module_of_every_structure() {
    for chosen in choices(wgsl::shared::TRAVERSE) {
        let chosen = without_mask(&chosen);
        let tables = tables(&chosen);
        let module = traversal_module(&chosen, &tables, 1).unwrap();
        let text = format!("{module}{USER}");
        let parsed =
            naga::front::wgsl::parse_str(&text).unwrap_or_else(|error| panic!("{}", error.emit_to_string(&text)));
        let flags = naga::valid::ValidationFlags::all();
        let found = naga::valid::Validator::new(flags, naga::valid::Capabilities::empty()).validate(&parsed);
        found.unwrap_or_else(|error| panic!("{chosen:?}: {}", error.emit_to_string(&text)));
        assert!(!module.contains("@group(0)"));
        // The triangles of binary BVHs and of others have the same number.
        let numbers: BTreeSet<&str> =
            module.split("@group(1) @binding(").skip(1).filter_map(|rest| Some(rest.split_once(')')?.0)).collect();
        assert_eq!(numbers.len(), MODULE_BUFFERS as usize, "{numbers:?}");
        // Two modules, of two scenes, collide without prefixes.
        assert!(naga::front::wgsl::parse_str(&format!("{module}{module}")).is_err());
        let other =
            traversal_module(&chosen, &tables, ModuleOptions { group: 2, prefix: "other_", accepts: Some("accepts") })
                .unwrap();
        // The function is called as one of the module's inside.
        let counts = "fn accepts(hit: other_Hit) -> bool { return other_normal_of(hit).x > 0.5; }";
        let text = format!("{module}{other}{counts}{USER}");
        naga::front::wgsl::parse_str(&text).unwrap_or_else(|error| panic!("{}", error.emit_to_string(&text)));
    }
}

/// A kernel whose rays the driver traces, with names that the module also has inside.
const OF_DRIVER: &str = "
@group(0) @binding(0) var<storage, read> driver_scene: array<rt_Ray>;
@group(0) @binding(1) var<storage, read_write> answers: array<rt_Hit>;
@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let ray = rt_ray(driver_scene[id.x].origin, vec3<f32>(1.0), 9.0);
    if !rt_occluded(ray) && !rt_occluded_masked(ray, 3u) || rt_is_incomplete {
        answers[id.x] = rt_closest_hit_masked(ray, 2u);
    } else {
        answers[id.x] = rt_closest_hit(ray);
    }
}
";

#[test]
fn a_kernel_includes_the_module_of_the_driver() {
    let text = driver_module(1, "rt_").unwrap() + OF_DRIVER;
    let parsed = naga::front::wgsl::parse_str(&text).unwrap_or_else(|error| panic!("{}", error.emit_to_string(&text)));
    let error_with = |capabilities| {
        let mut validator = naga::valid::Validator::new(naga::valid::ValidationFlags::all(), capabilities);
        validator.validate(&parsed).err().map(|error| error.emit_to_string(&text))
    };
    assert_eq!(error_with(naga::valid::Capabilities::RAY_QUERY), None);
    assert!(error_with(naga::valid::Capabilities::empty()).is_some(), "it needs ray queries");
    assert!(driver_module(1, "_").is_err());
}

#[test]
fn every_kernel_passes_the_lint() {
    let found: Vec<String> = kernels()
        .flat_map(|kernel| choices(kernel).into_iter().map(move |chosen| (kernel, chosen)))
        .flat_map(|(kernel, chosen)| lint(kernel, &chosen).unwrap_or_else(|error| panic!("{error}")))
        .collect();
    assert!(found.is_empty(), "{}", found.join("\n"));
}
