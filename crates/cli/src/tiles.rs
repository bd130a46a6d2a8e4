//! `canted tiles`: a store of tiles for scenes larger than memory.

use std::path::{Path, PathBuf};

use anyhow::{Result, anyhow};
use canted_obb::Affine;
use canted_renderer::has_one_level;
use canted_scene::{Instance, ReadError, Scene};
use canted_tiles::{TileError, TileWriter, WriteOptions};
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::json;

use crate::{
    load::{self, FileArgs},
    options,
    output::{self, Named},
};

/// Options of `canted tiles`.
#[derive(clap::Args)]
#[command(
    after_help = "Examples:\n  canted tiles city.stl -o city.tiles --memory 2G\n  canted tiles north.ply south.ply -o both.tiles\n  \
                  canted cast city.tiles --rays rays.csv --hits hits.csv"
)]
pub(crate) struct Args {
    /// Scenes: OBJ, PLY, STL, OFF, glTF, GLB or scene files (.toml), numbered one after another. Binary STL and binary PLY are read a part
    /// at a time, other files are read whole, one at a time.
    #[arg(required = true, value_name = "SCENE", id = "scene")]
    scenes: Vec<PathBuf>,
    #[command(flatten)]
    files: FileArgs,
    /// Folder of the store. It appears when it is complete; until then it is DIR.partial, which the same command continues after it was killed.
    /// A store of that name is replaced.
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Most triangles of a tile.
    #[arg(long, value_name = "N", default_value_t = 1 << 18)]
    tile_triangles: usize,
    /// Memory to take, about: a number of bytes with K, M, G or T for powers of 1024, such as 2G. What a scene that is read whole takes comes on top.
    #[arg(long, value_name = "BYTES", value_parser = options::Bytes::parse, default_value = "2G")]
    memory: u64,
    /// Number of CPU threads [default: all]
    #[arg(long, value_parser = options::threads, value_name = "N")]
    threads: Option<usize>,
    /// Print the report as JSON.
    #[arg(long)]
    json: bool,
}

/// Writes the store.
pub(crate) fn run(args: &Args) -> Result<()> {
    let mut inputs: Vec<Named> = vec![];
    inputs.extend(args.scenes.iter().map(|scene| ("SCENE", scene.as_path())));
    output::check_distinct(&inputs, &[("--output", &args.output)])?;
    options::use_threads(args.threads)?;
    let start = std::time::Instant::now();
    let options = WriteOptions { tile_triangles: args.tile_triangles, memory: args.memory, ..WriteOptions::default() };
    let mut writer = TileWriter::create(&args.output, options)?;
    let mut placed = Placed::default();
    for path in &args.scenes {
        placed.add(&mut writer, path, &args.files, args.memory)?;
    }
    placed.end(&mut writer)?;
    let bar = if output::is_quiet() { ProgressBar::hidden() } else { ProgressBar::new(1000) };
    if let Ok(style) = ProgressStyle::with_template("tiles {bar:40} {percent:>3} %  {elapsed} of about {duration}") {
        bar.set_style(style);
    }
    let written = writer.finish(&mut |part| bar.set_position((1000.0 * part) as u64));
    bar.finish_and_clear();
    let written = written?;
    let seconds = start.elapsed().as_secs_f64();
    if args.json {
        let facts = json!({
            "store": args.output.display().to_string(),
            "tiles": written.tiles,
            "resumed_tiles": written.resumed,
            "triangles": written.triangles,
            "bytes": written.bytes,
            "seconds": seconds,
        });
        return output::to_stdout(&facts.to_string());
    }
    output::note(&format!(
        "wrote {}: {} tiles, {} triangles, {} MiB in {seconds:.1} s",
        args.output.display(),
        written.tiles,
        written.triangles,
        written.bytes.div_ceil(1 << 20)
    ));
    Ok(())
}

/// What is in the store so far. Scenes without repeated meshes are one mesh together, in world space, as `canted cast` traces each of them.
#[derive(Default)]
struct Placed {
    /// Triangles of the mesh that is not ended, and its instances: the first triangle, and its number in the whole.
    n_flat: u64,
    flat: Vec<[u64; 2]>,
    /// The first number of the next scene.
    next: u64,
}

/// An error of the reader or of the writer.
enum StreamError {
    Read(ReadError),
    Tiles(TileError),
}

impl From<ReadError> for StreamError {
    fn from(error: ReadError) -> Self {
        Self::Read(error)
    }
}

impl Placed {
    /// Adds a scene.
    fn add(&mut self, writer: &mut TileWriter, path: &Path, files: &FileArgs, memory: u64) -> Result<()> {
        let (first, number) = (self.n_flat, self.next);
        let streamed = canted_scene::stream_triangles(path, memory / 2, |triangles| {
            self.n_flat += triangles.len() as u64;
            writer.push(triangles).map_err(StreamError::Tiles)
        });
        match streamed {
            Err(StreamError::Read(error)) => return Err(load::with_remedy(error)),
            Err(StreamError::Tiles(error)) => return Err(error.into()),
            Ok(Some(warnings)) => {
                warnings.iter().for_each(|warning| output::warn(&format!("{}: {warning}", path.display())));
                self.flat.push([first, number]);
                self.next += self.n_flat - first;
                return Ok(());
            }
            Ok(None) => {}
        }
        let options = if load::is_scene_file(path) { Default::default() } else { files.read_options(None, None) };
        let scene = load::scene(Some(path), &options)?;
        if scene.has_curves() {
            return Err(anyhow!("{}: tiles hold triangles, and the scene has curves", path.display()));
        }
        if scene.has_motion() {
            return Err(anyhow!("{}: tiles do not move; set `time` to one pose", path.display()));
        }
        // A scene beyond the capacity of one BVH is a mesh, too: it is divided.
        let is_flat = has_one_level(&scene, &Default::default()).unwrap_or(true);
        if is_flat {
            self.add_flat(writer, &scene)?;
        } else {
            self.add_placed(writer, &scene)?;
        }
        let end = |instance: &Instance| {
            u64::from(instance.first_primitive) + scene.meshes[instance.mesh.0 as usize].triangles.len() as u64
        };
        self.next += scene.instances.iter().map(end).max().unwrap_or(0);
        Ok(())
    }

    /// Adds all instances to the mesh, in world space.
    fn add_flat(&mut self, writer: &mut TileWriter, scene: &Scene) -> Result<()> {
        let is_alone = matches!(&scene.instances[..], [one] if one.world_from_object == Affine::IDENTITY);
        for instance in &scene.instances {
            let mesh = &scene.meshes[instance.mesh.0 as usize];
            self.flat.push([self.n_flat, self.next + u64::from(instance.first_primitive)]);
            self.n_flat += mesh.triangles.len() as u64;
            let in_world = |i: u32| match mesh.positions[i as usize] {
                position if is_alone => position,
                position => instance.world_from_object.point(position),
            };
            for part in mesh.triangles.chunks(1 << 14) {
                let corners: Vec<[[f32; 3]; 3]> = part.iter().map(|triangle| triangle.map(in_world)).collect();
                writer.push(&corners)?;
            }
        }
        Ok(())
    }

    /// Adds each mesh, and places its instances.
    fn add_placed(&mut self, writer: &mut TileWriter, scene: &Scene) -> Result<()> {
        self.end(writer)?;
        let mut numbers = vec![];
        for mesh in &scene.meshes {
            for part in mesh.triangles.chunks(1 << 14) {
                let corner = |triangle: &[u32; 3]| triangle.map(|i| mesh.positions[i as usize]);
                writer.push(&part.iter().map(corner).collect::<Vec<_>>())?;
            }
            numbers.push(writer.end_mesh()?);
        }
        for instance in &scene.instances {
            let own = [0, self.next + u64::from(instance.first_primitive)];
            writer.place(numbers[instance.mesh.0 as usize], instance.world_from_object, &[own])?;
        }
        Ok(())
    }

    /// Ends the mesh in world space.
    fn end(&mut self, writer: &mut TileWriter) -> Result<()> {
        if !self.flat.is_empty() {
            let mesh = writer.end_mesh()?;
            writer.place(mesh, Affine::IDENTITY, &self.flat)?;
            self.flat.clear();
            self.n_flat = 0;
        }
        Ok(())
    }
}
