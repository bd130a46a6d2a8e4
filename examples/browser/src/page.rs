//! The page: runs everything and shows pictures, times and differences.

use canted_gpu::{Choice, Gpu, Outcome};
use canted_trace::Intersect as _;
use serde_json::{Value, json};
use wasm_bindgen::{Clamped, JsCast, JsValue};
use wasm_bindgen_futures::JsFuture;
use web_sys::{CanvasRenderingContext2d, Document, HtmlCanvasElement, ImageData, RequestInit, Window};
use web_time::Instant;

use crate::Failure;
use crate::compare::{Differences, checksum, hits_of};
use crate::view::{SIZE, View};

/// Part of the address that asks for a report to the server.
const REPORT: &str = "report";

/// Part of the address that removes an instance on the device, so that the comparison must fail.
const WITHOUT_FIRST: &str = "without-first";

/// Runs everything; what goes wrong is shown.
pub(crate) async fn run() {
    let Some(window) = web_sys::window() else { return };
    let address = window.location().search().unwrap_or_default();
    let outcome = traced(&window, address.contains(WITHOUT_FIRST)).await;
    let (state, report) = match outcome {
        Ok(report) => ("Done.".to_owned(), report),
        Err(error) => (error.to_string(), json!({ "error": error.to_string() })),
    };
    if let Some(element) = document(&window).and_then(|document| document.get_element_by_id("state")) {
        element.set_text_content(Some(&state));
    }
    if address.contains(REPORT) {
        let request = RequestInit::new();
        request.set_method("POST");
        request.set_body(&JsValue::from_str(&report.to_string()));
        // Nobody is left to hear that nobody listens.
        let _ = JsFuture::from(window.fetch_with_str_and_init("report", &request)).await;
    }
}

/// Traces on device and CPU, and shows the results.
async fn traced(window: &Window, without_first: bool) -> Result<Value, Failure> {
    let document = document(window).ok_or("there is no document")?;
    let view = View::new()?;
    let rays = view.camera_rays()?;
    let gpu = Gpu::open(&Choice::Best).await?;

    let start = Instant::now();
    let scene = view.on_device(&gpu, without_first).await?;
    let build = milliseconds(start);
    // The browser compiles kernels when they are first used.
    scene.closest_hits(&gpu, &rays[..1]).await?;
    let start = Instant::now();
    let outcomes = scene.closest_hits(&gpu, &rays).await?;
    let trace = milliseconds(start);
    let device_hits = hits_of(&outcomes);
    let shadow_rays = view.shadow_rays(&device_hits);
    let shadow_outcomes = scene.occluded(&gpu, &shadow_rays.iter().flatten().copied().collect::<Vec<_>>()).await?;
    draw(&document, "device", &view.picture(&device_hits, &spread(&shadow_rays, &shadow_outcomes)))?;

    let start = Instant::now();
    let tlas = view.on_cpu()?;
    let cpu_build = milliseconds(start);
    let start = Instant::now();
    let cpu_hits: Vec<_> = rays.iter().map(|ray| tlas.closest_hit(ray)).collect();
    let cpu_trace = milliseconds(start);
    let cpu_shadow_rays = view.shadow_rays(&cpu_hits);
    let in_shadow: Vec<bool> =
        cpu_shadow_rays.iter().map(|ray| ray.as_ref().is_some_and(|ray| tlas.occluded(ray))).collect();
    draw(&document, "cpu", &view.picture(&cpu_hits, &in_shadow))?;

    let same_rays: Vec<bool> = shadow_rays.iter().flatten().map(|ray| tlas.occluded(ray)).collect();
    let camera = Differences::of_hits(&outcomes, &cpu_hits);
    let shadow = Differences::of_occlusion(&shadow_outcomes, &same_rays);
    let info = gpu.info();
    let report = json!({
        "adapter": format!("{} ({}, {})", info.name, info.kind, info.backend),
        "build": { "device_ms": build, "cpu_ms": cpu_build },
        "trace": { "device_ms": trace, "cpu_ms": cpu_trace },
        "checksum": { "device": checksum(&device_hits), "cpu": checksum(&cpu_hits) },
        "camera": counts(rays.len(), &camera),
        "shadow": counts(same_rays.len(), &shadow),
    });
    show(&document, &report)?;
    Ok(report)
}

fn counts(rays: usize, of: &Differences) -> Value {
    let &Differences { hits, one_side, triangle, distance, incomplete } = of;
    json!({
        "rays": rays, "hits": hits, "one_side": one_side, "triangle": triangle, "distance": distance,
        "incomplete": incomplete,
    })
}

/// Whether each pixel is in shadow, from the answers for pixels with a ray.
fn spread<R>(rays: &[Option<R>], outcomes: &[Outcome<bool>]) -> Vec<bool> {
    let mut answers = outcomes.iter().map(|outcome| *outcome == Outcome::Complete(true));
    rays.iter().map(|ray| ray.is_some() && answers.next() == Some(true)).collect()
}

fn document(window: &Window) -> Option<Document> {
    window.document()
}

/// Draws a picture into a canvas.
fn draw(document: &Document, canvas: &str, rgba: &[u8]) -> Result<(), Failure> {
    let [width, height] = SIZE.map(|pixels| u32::try_from(pixels).unwrap_or(u32::MAX));
    let canvas = document.get_element_by_id(canvas).ok_or("a canvas is missing")?;
    let canvas: HtmlCanvasElement = canvas.dyn_into().map_err(|_| "an element is not a canvas")?;
    canvas.set_width(width);
    canvas.set_height(height);
    let context = canvas.get_context("2d").ok().flatten().ok_or("a canvas has no context")?;
    let context: CanvasRenderingContext2d = context.dyn_into().map_err(|_| "a canvas has another context")?;
    let image = ImageData::new_with_u8_clamped_array_and_sh(Clamped(rgba), width, height);
    let image = image.map_err(|_| "a picture cannot be made")?;
    context.put_image_data(&image, 0.0, 0.0).map_err(|_| "a picture cannot be drawn".into())
}

/// Shows the report as a table.
fn show(document: &Document, report: &Value) -> Result<(), Failure> {
    let table = document.get_element_by_id("table").ok_or("the table is missing")?;
    let number =
        |value: &Value| value.as_f64().map_or_else(|| value.to_string(), |x| format!("{}", (1e7 * x).round() / 1e7));
    let mut rows = format!("<tr><th>adapter<td colspan=6>{}", report["adapter"].as_str().unwrap_or_default());
    for name in ["build", "trace", "checksum", "camera", "shadow"] {
        let cells = report[name].as_object().into_iter().flatten();
        let cells: String = cells.map(|(key, value)| format!("<td>{key} {}", number(value))).collect();
        rows += &format!("<tr><th>{name}{cells}");
    }
    table.set_inner_html(&rows);
    Ok(())
}

fn milliseconds(start: Instant) -> f64 {
    (start.elapsed().as_secs_f64() * 1e4).round() / 10.0
}
