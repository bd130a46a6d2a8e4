//! The report of `canted render`, as text and as JSON.

use std::time::Duration;

use anyhow::Result;
use canted_film::Film;
use canted_obb::Obb;
use canted_renderer::{BottomLevel, SceneBvh, SceneLevels, Settings, StageTimes, UnusedFeature};
use canted_scene::{Camera, Environment, Scene};
use canted_wide::{NodeKind, SimdPath};
use serde_json::{Value, json};

use super::Choice;
use crate::{light::LightSource, options::Named as _, output, process};

/// A name and a value.
pub(super) type Fact = (&'static str, Value);

/// Facts about the scene and its acceleration structure.
pub(super) fn of_structure(scene: &Scene, scene_bvh: &SceneBvh) -> Vec<Fact> {
    let bvhs = scene_bvh.bottom();
    // The ground is no part of what the file has.
    let n_ground = usize::from(scene.ground.is_some());
    let of_ground = scene.ground.and_then(|_| scene.meshes.last()).map_or(0, |mesh| mesh.triangles.len());
    let mut facts = vec![
        ("meshes", json!(scene.meshes.len() - n_ground)),
        ("instances", json!(scene.instances.len() - n_ground)),
        ("unique_triangles", json!(scene.n_unique_triangles() - of_ground)),
        ("placed_triangles", json!(scene.n_placed_triangles() - of_ground)),
        ("levels", json!(if matches!(scene_bvh.levels(), SceneLevels::Two(_)) { 2 } else { 1 })),
        ("volumes", json!(volumes_of(bvhs))),
        ("structure_bytes", json!(scene_bvh.n_bytes())),
        ("build_seconds", json!(scene_bvh.build_time.as_secs_f64())),
    ];
    if scene.has_curves() {
        facts.push(("placed_segments", json!(scene.n_placed_segments())));
    }
    if bvhs.iter().any(|bvh| !matches!(bvh, BottomLevel::Bvh2(..) | BottomLevel::Bih(_) | BottomLevel::KdTree(_))) {
        facts.push(("simd", json!(SimdPath::detect().name())));
    }
    facts
}

/// Facts about the camera, the light and what surrounds the scene.
pub(super) fn of_view(scene: &Scene, camera: &Camera, choice: &Choice) -> Vec<Fact> {
    let light = match (choice.source, choice.default_light) {
        (_, Some((preset, _))) => preset.name().to_owned(),
        (LightSource::Emission, None) => "surfaces that emit".to_owned(),
        (LightSource::Given | LightSource::Default, None) => {
            let lights = match scene.lights.len() {
                0 => None,
                1 => Some("1 light".to_owned()),
                n => Some(format!("{n} lights")),
            };
            let environment = scene.environment.as_ref().map(|environment| match environment {
                Environment::Constant(_) => "a constant environment".to_owned(),
                Environment::Image(image) => format!("the environment {}", image.name),
            });
            let parts: Vec<String> = lights.into_iter().chain(environment).collect();
            if parts.is_empty() { "none".to_owned() } else { parts.join(", ") }
        }
    };
    let background = match scene.background {
        Some(color) => json!(color),
        None => json!("environment"),
    };
    let mut facts = vec![
        ("camera", json!(choice.camera.text(scene))),
        ("eye", json!(camera.eye)),
        ("target", json!(camera.target)),
        ("light", json!(light)),
        ("light_reason", json!(choice.light_reason)),
        ("background", background),
        ("ground", json!(if scene.ground.is_some() { "on" } else { "off" })),
    ];
    facts.extend(choice.default_light.map(|(_, strength)| ("default_light", json!(strength))));
    facts.extend(choice.exposure.map(|stops| ("exposure", json!(stops))));
    facts
}

/// Facts about the samples.
pub(super) fn of_film(film: &Film, settings: &Settings, time: Duration, known: &[Fact]) -> Vec<Fact> {
    let [n_rays, n_samples] = [film.n_rays(), film.n_samples()].map(|n| n as f64);
    let mut facts = vec![
        ("integrator", json!(settings.integrator.name())),
        ("bounces", json!(settings.bounces)),
        ("rays", json!(film.n_rays())),
        ("rays_per_second", json!(n_rays / time.as_secs_f64())),
        ("dropped_samples", json!(film.n_dropped())),
    ];
    // A time limit decides the number.
    if known.iter().all(|(key, _)| *key != "samples_per_pixel") {
        facts.insert(0, ("samples_per_pixel", json!(settings.range().len())));
    }
    if settings.part.is_some() {
        facts.push(("samples", json!(format!("{:?}", settings.range()))));
    }
    if settings.noise.is_some() {
        let n_pixels = f64::from(settings.width) * f64::from(settings.height);
        facts.push(("noise_reached", json!(film.error())));
        facts.push(("mean_samples_per_pixel", json!(n_samples / n_pixels)));
    }
    facts
}

/// What the threads of the CPU spent their time on; nothing where they did nothing.
pub(super) fn of_threads(times: &StageTimes) -> Vec<Fact> {
    let seconds = times.seconds();
    if seconds.iter().sum::<f64>() == 0.0 {
        return vec![];
    }
    THREAD_SECONDS.into_iter().zip(seconds.map(|seconds| json!(seconds))).collect()
}

/// Seconds of all threads of the CPU together: [`StageTimes::STAGES`].
const THREAD_SECONDS: [&str; 4] =
    ["camera_thread_seconds", "rays_thread_seconds", "shading_thread_seconds", "film_thread_seconds"];

/// Facts that are sums over frames, in addition to [`THREAD_SECONDS`].
const SUMS: [&str; 12] = [
    "load_seconds",
    "build_seconds",
    "device_seconds",
    "trace_seconds",
    "denoise_seconds",
    "rays",
    "dropped_samples",
    "gpu_tiles",
    "gpu_uploaded_bytes",
    "gpu_downloaded_bytes",
    "gpu_dispatches",
    "gpu_exact_rays",
];

/// The facts of a sequence of frames and of one more: sums, or the values of the last frame.
pub(super) fn sum(mut all: Vec<Fact>, frame: Vec<Fact>) -> Vec<Fact> {
    for (key, value) in frame {
        match all.iter_mut().find(|(known, _)| *known == key) {
            Some((_, old)) if SUMS.contains(&key) || THREAD_SECONDS.contains(&key) => {
                *old = match (old.as_u64(), value.as_u64()) {
                    (Some(a), Some(b)) => json!(a + b),
                    _ => json!(old.as_f64().unwrap_or(0.0) + value.as_f64().unwrap_or(0.0)),
                };
            }
            Some((_, old)) => *old = value,
            None => all.push((key, value)),
        }
    }
    let number = |key: &str| all.iter().find(|(known, _)| *known == key).and_then(|(_, value)| value.as_f64());
    if let (Some(rays), Some(seconds)) = (number("rays"), number("trace_seconds"))
        && let Some((_, rate)) = all.iter_mut().find(|(key, _)| *key == "rays_per_second")
    {
        *rate = json!(rays / seconds);
    }
    all
}

/// The warning about samples that are not finite: their number, and the first pixel by column and row from the top left.
pub(crate) fn dropped_samples(film: &Film) -> Option<String> {
    let [x, y] = film.first_dropped()?;
    Some(match film.n_dropped() {
        1 => format!("dropped 1 sample that was not finite, in pixel ({x}, {y})"),
        n => format!("dropped {n} samples that were not finite, the first in pixel ({x}, {y})"),
    })
}

/// A description of the bounding volumes. All bottom-level BVHs are of one kind.
fn volumes_of(bvhs: &[BottomLevel]) -> String {
    let mut nodes = [0; NodeKind::ALL.len()];
    let mut n_rotated = 0;
    let mut add = |of_one: [usize; NodeKind::ALL.len()], frame| {
        nodes = std::array::from_fn(|i| nodes[i] + of_one[i]);
        n_rotated += usize::from(frame != Obb::IDENTITY_FRAME);
    };
    for bvh in bvhs {
        match bvh {
            BottomLevel::Bvh2(_, strategy) => return strategy.name().to_owned(),
            BottomLevel::Bih(_) => return "bounding intervals".to_owned(),
            BottomLevel::KdTree(_) => return "kd-tree cells".to_owned(),
            BottomLevel::Wide(wide) => add(wide.sizes().nodes, wide.frame()),
            BottomLevel::Moving(moving) => add(moving.sizes().nodes, moving.frame()),
            BottomLevel::Segments(bvh) => add(bvh.sizes().nodes, bvh.frame()),
            BottomLevel::Cubics(bvh) => add(bvh.sizes().nodes, bvh.frame()),
            BottomLevel::Ribbons(bvh) => add(bvh.sizes().nodes, bvh.frame()),
            BottomLevel::CubicRibbons(bvh) => add(bvh.sizes().nodes, bvh.frame()),
            BottomLevel::Patches(bvh) => add(bvh.sizes().nodes, bvh.frame()),
            BottomLevel::MovingCurves(bvh) => {
                let (sizes, frame) = bvh.sizes_and_frame();
                add(sizes.nodes, frame);
            }
        }
    }
    let n: usize = nodes.iter().sum();
    let n_oriented = n - nodes[NodeKind::Aligned as usize];
    let text = match (bvhs.len(), n) {
        (0, _) => return "none".to_owned(),
        (_, 0) => "wide, leaves only".to_owned(),
        _ => format!("wide, {n_oriented} of {n} nodes oriented"),
    };
    match (bvhs.len(), n_rotated) {
        (_, 0) => text,
        (1, _) => format!("{text}, mesh rotated"),
        (n, n_rotated) => format!("{text}, {n_rotated} of {n} meshes rotated"),
    }
}

/// The pipeline parts that a scene does not need, as JSON. Test counters are a part too: only heat maps count tests.
pub(crate) fn not_needed(parts: &[UnusedFeature], has_counters: bool) -> Value {
    const COUNTERS: UnusedFeature = UnusedFeature { feature: "counters", reason: "no heat map was requested" };
    let counters = (!has_counters).then_some(&COUNTERS);
    parts.iter().chain(counters).map(|unused| json!({ "part": unused.feature, "reason": unused.reason })).collect()
}

/// The parts of [`not_needed`] in one line.
pub(crate) fn parts_text(parts: &Value) -> String {
    let word = |part: &Value, key: &str| part[key].as_str().unwrap_or_default().to_owned();
    let parts = parts.as_array().into_iter().flatten();
    parts.map(|part| format!("{} ({})", word(part, "part"), word(part, "reason"))).collect::<Vec<_>>().join(", ")
}

/// Prints the facts: in a few lines, with `-v` one line each, with `-q` none; or as one JSON object.
pub(super) fn report(facts: &[Fact], as_json: bool) -> Result<()> {
    if as_json {
        let object: serde_json::Map<String, Value> =
            facts.iter().map(|(key, value)| ((*key).to_owned(), value.clone())).collect();
        return output::to_stdout(&Value::Object(object).to_string());
    }
    if output::is_quiet() {
        return Ok(());
    }
    if !output::is_verbose() {
        let lines = Summary(facts).lines([output::n_warnings(), output::n_skipped()]);
        return lines.iter().try_for_each(|(name, text)| output::to_stdout(&format!("{name:<9} {text}")));
    }
    for (key, value) in facts {
        let text = match (*key, value) {
            (key, Value::Number(n)) if key.ends_with("_bytes") => process::human(n.as_u64().unwrap_or(0)),
            (key, Value::Number(n)) if key.ends_with("seconds") => format!("{:.3} s", n.as_f64().unwrap_or(0.0)),
            ("rays_per_second", Value::Number(n)) => format!("{:.2} M", n.as_f64().unwrap_or(0.0) * 1e-6),
            ("noise_reached", Value::Number(n)) => format!("{:.5}", n.as_f64().unwrap_or(0.0)),
            ("noise_reached", Value::Null) => "unknown".to_owned(),
            (_, Value::Number(n)) if n.is_f64() => format!("{:.2}", n.as_f64().unwrap_or(0.0)),
            ("size", Value::Array(sides)) => format!("{} x {}", sides[0], sides[1]),
            ("eye" | "target" | "background", Value::Array(numbers)) => {
                let numbers = numbers.iter().map(|n| format!("{:.4}", n.as_f64().unwrap_or(0.0)));
                numbers.collect::<Vec<_>>().join(", ")
            }
            ("not_needed", parts) => parts_text(parts),
            (_, Value::String(text)) => text.clone(),
            (_, other) => other.to_string(),
        };
        output::to_stdout(&format!("{:<24} {text}", key.replace('_', " ").replace(" bytes", "")))?;
    }
    Ok(())
}

/// The facts for a person.
struct Summary<'a>(&'a [Fact]);

impl Summary<'_> {
    fn get(&self, key: &str) -> Option<&Value> {
        self.0.iter().find(|(known, _)| *known == key).map(|(_, value)| value).filter(|value| !value.is_null())
    }

    fn text(&self, key: &str) -> Option<String> {
        self.get(key).map(|value| value.as_str().map_or_else(|| value.to_string(), str::to_owned))
    }

    fn seconds(&self, key: &str) -> Option<String> {
        self.get(key)?.as_f64().map(|seconds| format!("{seconds:.2} s"))
    }

    /// At most eight lines, each with its name.
    fn lines(&self, [n_warnings, n_notes]: [usize; 2]) -> Vec<(&'static str, String)> {
        let ignored = match [n_warnings, n_notes] {
            [0, 0] => None,
            [1, 0] => Some("see the warning above".to_owned()),
            [0, 1] => Some("see the note above".to_owned()),
            [n, 0] => Some(format!("see the {n} warnings above")),
            [n, m] => Some(format!("see the {} warnings and notes above", n + m)),
        };
        let all = [
            ("picture", self.picture()),
            ("scene", self.scene()),
            ("camera", self.camera()),
            ("light", self.light()),
            ("samples", self.samples()),
            ("tests", self.tests()),
            ("time", self.time()),
            ("ignored", ignored),
        ];
        all.into_iter().filter_map(|(name, text)| Some((name, text?))).collect()
    }

    fn picture(&self) -> Option<String> {
        let mut text = self.text("picture")?;
        if let Some(Value::Array(sides)) = self.get("size") {
            text += &format!(", {} x {}", sides[0], sides[1]);
        }
        if let (Some(rendered), Some(kept)) = (self.get("rendered_frames"), self.get("kept_frames")) {
            text += &format!(", {rendered} frames rendered, {kept} kept");
        }
        let is_replaced = self.get("replaced") == Some(&Value::Bool(true));
        Some(text + if is_replaced { "; the file that was there is replaced" } else { "" })
    }

    fn scene(&self) -> Option<String> {
        let (name, Some(n)) = (self.text("scene")?, self.get("placed_triangles").and_then(Value::as_u64)) else {
            return self.text("scene");
        };
        let plural = |n: u64, what: &str| format!("{} {what}{}", grouped(n), if n == 1 { "" } else { "s" });
        let instances = self.get("instances").and_then(Value::as_u64).filter(|&n| n > 1);
        let instances = instances.map(|n| format!(" in {}", plural(n, "instance"))).unwrap_or_default();
        let segments = self.get("placed_segments").and_then(Value::as_u64).map(|n| plural(n, "segment"));
        let triangles = (n > 0 || segments.is_none()).then(|| plural(n, "triangle"));
        let parts: Vec<String> = [triangles, segments].into_iter().flatten().collect();
        Some(format!("{name}, {}{instances}", parts.join(", ")))
    }

    /// Where the camera comes from, its position and what it looks at.
    fn camera(&self) -> Option<String> {
        let point = |key: &str| self.get(key)?.as_array()?.iter().map(Value::as_f64).collect::<Option<Vec<f64>>>();
        let (eye, target) = (point("eye")?, point("target")?);
        // Five digits of the largest coordinate.
        let scale = eye.iter().chain(&target).fold(0.0, |scale: f64, x| scale.max(x.abs()));
        let n_decimals = if scale > 0.0 { 4.0 - scale.log10().floor() } else { 0.0 };
        let text = |point: &[f64]| {
            point.iter().map(|&x| rounded(x, n_decimals.max(0.0) as usize)).collect::<Vec<_>>().join(",")
        };
        Some(format!("{}: --eye {} --target {}", self.text("camera")?, text(&eye), text(&target)))
    }

    fn light(&self) -> Option<String> {
        // An f32, which as JSON has all digits of an f64.
        let exposure =
            self.get("exposure").and_then(Value::as_f64).map(|stops| format!(", --exposure {}", stops as f32));
        let reason = self.text("light_reason").map(|reason| format!(" ({reason})"));
        self.text("light").map(|text| text + &reason.unwrap_or_default() + &exposure.unwrap_or_default())
    }

    fn samples(&self) -> Option<String> {
        let at_most = self.text("samples_per_pixel")?;
        let number = |key: &str| self.get(key).and_then(Value::as_f64);
        let n = match number("mean_samples_per_pixel") {
            Some(mean) => format!("mean {mean:.1} of at most {at_most}"),
            None => at_most,
        };
        let noise = number("noise_reached").map(|noise| format!(", noise {noise:.4}")).unwrap_or_default();
        let integrator = self.text("integrator").map(|name| format!(", --integrator {name}")).unwrap_or_default();
        let denoised = if self.get("denoise_seconds").is_some() { ", denoised" } else { "" };
        let device = self.text("device").map(|name| format!(", on {name}")).unwrap_or_default();
        Some(format!("{n} per pixel{noise}{integrator}{denoised}{device}"))
    }

    /// The means of a heat map.
    fn tests(&self) -> Option<String> {
        let mean = |key: &str| self.get(key)?.as_f64().map(|mean| format!("{mean:.2}"));
        let (boxes, triangles) = (mean("box_tests_per_ray")?, mean("triangle_tests_per_ray")?);
        Some(format!("{boxes} of boxes and {triangles} of triangles per ray"))
    }

    fn time(&self) -> Option<String> {
        let stages = [
            ("load_seconds", "reading"),
            ("build_seconds", "building"),
            ("choice_seconds", "choosing view and light"),
            ("device_seconds", "preparing the device"),
            ("trace_seconds", "tracing"),
            ("denoise_seconds", "denoising"),
            ("write_seconds", "writing"),
        ];
        // What takes no time is not named.
        let takes_time = |key: &str| self.get(key).and_then(Value::as_f64).is_some_and(|seconds| seconds >= 0.005);
        let stages = stages.iter().filter(|(key, _)| takes_time(key));
        let stages = stages.filter_map(|(key, name)| Some(format!("{name} {}", self.seconds(key)?)));
        let stages = stages.collect::<Vec<_>>().join(", ");
        Some(format!("{}{}", self.seconds("seconds")?, if stages.is_empty() { stages } else { format!(" ({stages})") }))
    }
}

/// A number with commas between thousands.
fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let groups = digits.as_bytes().rchunks(3).rev();
    groups.map(|group| String::from_utf8_lossy(group).into_owned()).collect::<Vec<_>>().join(",")
}

/// A number with at most this many decimals.
fn rounded(x: f64, n_decimals: usize) -> String {
    let text = format!("{x:.n_decimals$}");
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::AtomicBool;

    use canted_obb::Affine;
    use canted_renderer::{SceneBvhConfig, render};
    use canted_scene::{Camera, Instance, Material, MaterialId, Mesh, MeshId, Part, Projection};

    use super::*;

    /// A film of 4 x 2 pixels, each one unit of the plane z = 0, of a rectangle between two corners that emits light.
    fn film(emission: f32, [left, top, right, bottom]: [f32; 4], samples: u32) -> Film {
        // The center of the picture is at x = 2, y = -1: rows go down and y goes up.
        let corners = [[left, top], [left, bottom], [right, bottom], [right, top]];
        let mesh = Mesh {
            positions: corners.map(|[x, y]| [x, -y, 0.0]).to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
            parts: vec![Part { first_triangle: 0, material: MaterialId(0) }],
            ..Mesh::default()
        };
        let world_from_object = Affine::IDENTITY;
        let instance =
            Instance { mesh: MeshId(0), world_from_object, world_from_object_close: None, first_primitive: 0 };
        let scene = Scene {
            meshes: vec![mesh],
            instances: vec![instance],
            materials: vec![Material { emission: [0.0, emission, 0.0], ..Material::default() }],
            ..Scene::default()
        };
        let projection = Projection::Orthographic { height: 2.0 };
        let camera = Camera { projection, ..Camera::pinhole([2.0, -1.0, 5.0], [2.0, -1.0, 0.0], [0.0, 1.0, 0.0], 1.0) };
        let settings = Settings { width: 4, height: 2, samples, ..Settings::default() };
        let bvh = SceneBvh::build(&scene, &SceneBvhConfig::default()).unwrap();
        render(&scene, &bvh, &camera, &settings, &|_, _| (), &AtomicBool::new(false)).unwrap()
    }

    #[test]
    fn counts_samples_that_are_not_finite() {
        let warning = |emission, corners, samples| dropped_samples(&film(emission, corners, samples));
        // Covers the pixels (2, 1) and (3, 1).
        let two = [2.0, 1.0, 4.0, 2.0];
        assert_eq!(
            warning(f32::NAN, two, 3).as_deref(),
            Some("dropped 6 samples that were not finite, the first in pixel (2, 1)")
        );
        let one = [3.0, 0.0, 4.0, 1.0];
        assert_eq!(
            warning(f32::INFINITY, one, 1).as_deref(),
            Some("dropped 1 sample that was not finite, in pixel (3, 0)")
        );
        assert_eq!(warning(1.0, two, 3), None);
    }

    #[test]
    fn the_report_has_at_most_eight_lines() {
        let facts: Vec<Fact> = vec![
            ("scene", json!("a.glb")),
            ("picture", json!("canted.png")),
            ("replaced", json!(true)),
            ("size", json!([64, 48])),
            ("instances", json!(2)),
            ("placed_triangles", json!(1_234_567)),
            ("camera", json!("frames the scene")),
            ("eye", json!([1.23456, -0.00001, 1234.5])),
            ("target", json!([0.5, 0.0, 20.0])),
            ("light", json!("studio")),
            ("exposure", json!(-1.5)),
            ("integrator", json!("path")),
            ("samples_per_pixel", json!(16)),
            ("device", json!("cpu")),
            ("load_seconds", json!(0.5)),
            ("write_seconds", json!(0.001)),
            ("choice_seconds", json!(0.02)),
            ("trace_seconds", json!(1.254)),
            ("denoise_seconds", json!(0.25)),
            ("box_tests_per_ray", json!(1.0)),
            ("triangle_tests_per_ray", json!(2.5)),
            ("seconds", json!(2.004)),
        ];
        let lines = Summary(&facts).lines([2, 0]);
        let text: Vec<String> = lines.iter().map(|(name, text)| format!("{name}: {text}")).collect();
        assert_eq!(
            text,
            [
                "picture: canted.png, 64 x 48; the file that was there is replaced",
                "scene: a.glb, 1,234,567 triangles in 2 instances",
                "camera: frames the scene: --eye 1.2,0,1234.5 --target 0.5,0,20",
                "light: studio, --exposure -1.5",
                "samples: 16 per pixel, --integrator path, denoised, on cpu",
                "tests: 1.00 of boxes and 2.50 of triangles per ray",
                "time: 2.00 s (reading 0.50 s, choosing view and light 0.02 s, tracing 1.25 s, denoising 0.25 s)",
                "ignored: see the 2 warnings above",
            ]
        );
        assert_eq!(Summary(&facts[..2]).lines([0, 0]).len(), 2);
        assert_eq!(Summary(&[]).lines([0, 1]), [("ignored", "see the note above".to_owned())]);
    }
}
