//! Dividing triangles by their centroids, on disk until a part fits into memory, then in memory.
//!
//! On disk, planes at the medians of a sample divide a file into parts of similar sizes, whatever the distribution. Where centroids are equal, so
//! that no plane divides them, triangles are divided by their numbers.

use std::fs::{self, File};
use std::io::{BufReader, BufWriter, Read as _, Seek as _, SeekFrom, Write as _};
use std::path::{Path, PathBuf};

use crate::error::{Named as _, TileError};

/// A triangle with its number in the mesh.
#[derive(Clone, Copy, Debug)]
pub(super) struct Record {
    pub(super) number: u32,
    pub(super) corners: [[f32; 3]; 3],
}

/// Bytes of a triangle in a spool, with its number.
const RECORD_BYTES: usize = 40;

/// Bytes of a triangle whose number is its place.
const FLAT_BYTES: usize = 36;

/// Triangles of a sample.
const SAMPLE: usize = 1 << 14;

/// Most parts of a file: as many are open at once.
const MOST_PARTS: usize = 64;

/// Bytes of the buffer of a part.
const BUFFER: usize = 1 << 18;

impl Record {
    fn centroid(&self) -> [f32; 3] {
        let [a, b, c] = self.corners;
        // Scaled first, so that no sum overflows.
        std::array::from_fn(|k| a[k] / 3.0 + b[k] / 3.0 + c[k] / 3.0)
    }

    fn to_bytes(self) -> [u8; RECORD_BYTES] {
        let mut bytes = [0; RECORD_BYTES];
        bytes[..4].copy_from_slice(&self.number.to_ne_bytes());
        for (out, x) in bytes[4..].chunks_exact_mut(4).zip(self.corners.as_flattened()) {
            out.copy_from_slice(&x.to_ne_bytes());
        }
        bytes
    }

    fn of_bytes(number: u32, bytes: &[u8]) -> Self {
        let mut corners = [[0.0; 3]; 3];
        for (x, word) in corners.as_flattened_mut().iter_mut().zip(bytes.as_chunks::<4>().0) {
            *x = f32::from_ne_bytes(*word);
        }
        Self { number, corners }
    }
}

/// A file of triangles that is being written.
#[derive(Debug)]
pub(super) struct Spool {
    path: PathBuf,
    file: BufWriter<File>,
    n: u64,
}

impl Spool {
    pub(super) fn create(path: PathBuf) -> Result<Self, TileError> {
        let file = File::create(&path).named("write", &path)?;
        Ok(Self { path, file: BufWriter::with_capacity(BUFFER, file), n: 0 })
    }

    /// Triangles so far.
    pub(super) fn n(&self) -> u64 {
        self.n
    }

    /// Appends triangles whose numbers are their places.
    pub(super) fn write_flat(&mut self, bytes: &[u8]) -> Result<(), TileError> {
        self.n += (bytes.len() / FLAT_BYTES) as u64;
        self.file.write_all(bytes).named("write", &self.path)
    }

    fn write(&mut self, record: Record) -> Result<(), TileError> {
        self.n += 1;
        self.file.write_all(&record.to_bytes()).named("write", &self.path)
    }

    /// The file, and its number of triangles.
    pub(super) fn finish(mut self) -> Result<(PathBuf, u64), TileError> {
        self.file.flush().named("write", &self.path)?;
        Ok((self.path, self.n))
    }
}

/// A file of triangles to divide.
struct Part {
    path: PathBuf,
    n: u64,
    /// Whether numbers are places.
    is_flat: bool,
}

impl Part {
    fn record_bytes(&self) -> usize {
        if self.is_flat { FLAT_BYTES } else { RECORD_BYTES }
    }

    /// Calls `visit` with every triangle, in order.
    fn each(&self, visit: &mut dyn FnMut(Record) -> Result<(), TileError>) -> Result<(), TileError> {
        let file = File::open(&self.path).named("read", &self.path)?;
        let mut file = BufReader::with_capacity(BUFFER, file);
        let mut bytes = vec![0; self.record_bytes()];
        for place in 0..self.n {
            file.read_exact(&mut bytes).named("read", &self.path)?;
            visit(self.record(place, &bytes))?;
        }
        Ok(())
    }

    fn record(&self, place: u64, bytes: &[u8]) -> Record {
        match self.is_flat {
            true => Record::of_bytes(place as u32, bytes),
            false => {
                let (number, rest) = bytes.split_first_chunk::<4>().unwrap_or((&[0; 4], &[]));
                Record::of_bytes(u32::from_ne_bytes(*number), rest)
            }
        }
    }

    /// Centroids of triangles at regular places.
    fn sample(&self) -> Result<Vec<[f32; 3]>, TileError> {
        let mut file = File::open(&self.path).named("read", &self.path)?;
        let mut bytes = vec![0; self.record_bytes()];
        let n = self.n.min(SAMPLE as u64);
        (0..n)
            .map(|i| {
                let place = i * self.n / n;
                file.seek(SeekFrom::Start(place * bytes.len() as u64)).named("read", &self.path)?;
                file.read_exact(&mut bytes).named("read", &self.path)?;
                Ok(self.record(place, &bytes).centroid())
            })
            .collect()
    }

    fn remove(&self) -> Result<(), TileError> {
        fs::remove_file(&self.path).named("remove", &self.path)
    }
}

/// Calls `write` with the triangles of each tile, in order of their numbers: at most `tile` of them. Removes the file.
pub(super) fn divide(
    path: PathBuf,
    n: u64,
    most: usize,
    tile: usize,
    write: &mut dyn FnMut(&[Record]) -> Result<(), TileError>,
) -> Result<(), TileError> {
    let mut open = vec![Part { path, n, is_flat: true }];
    let mut n_files = 0;
    while let Some(part) = open.pop() {
        if part.n <= most as u64 {
            let mut records = Vec::with_capacity(part.n as usize);
            part.each(&mut |record| {
                records.push(record);
                Ok(())
            })?;
            part.remove()?;
            if !records.is_empty() {
                in_memory(&mut records, tile, write)?;
            }
        } else {
            // The first part comes next.
            open.extend(on_disk(&part, most, &mut n_files)?.into_iter().rev());
            part.remove()?;
        }
    }
    Ok(())
}

/// A plane at a median, or a part.
enum Planes {
    Part(usize),
    At { axis: usize, value: f32, sides: Box<[Planes; 2]> },
}

impl Planes {
    /// Divides a sample into `n` parts, a power of two; `next` is the number of the next part.
    fn of(sample: &mut [[f32; 3]], n: usize, next: &mut usize) -> Self {
        if n > 1
            && let Some((axis, middle)) = median(sample.len(), &|i| sample[i], 1, 2)
        {
            sample.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]));
            let value = sample[middle][axis];
            let least = sample.iter().fold(f32::INFINITY, |least, c| least.min(c[axis]));
            // Centroids at the plane are above it, so some must be below.
            let value = if value > least { value } else { above(sample, axis, least) };
            let split = partition(sample, |c| c[axis] < value);
            let (below, rest) = sample.split_at_mut(split);
            let sides = [Self::of(below, n / 2, next), Self::of(rest, n / 2, next)];
            return Self::At { axis, value, sides: Box::new(sides) };
        }
        *next += 1;
        Self::Part(*next - 1)
    }

    fn part_of(&self, centroid: [f32; 3]) -> usize {
        let mut planes = self;
        loop {
            match planes {
                Self::Part(part) => return *part,
                Self::At { axis, value, sides } => planes = &sides[usize::from(centroid[*axis] >= *value)],
            }
        }
    }
}

/// The least coordinate above `least`.
fn above(sample: &[[f32; 3]], axis: usize, least: f32) -> f32 {
    sample.iter().map(|c| c[axis]).filter(|&x| x > least).fold(f32::INFINITY, f32::min)
}

/// Moves those of which `is_first` is true to the front; their number.
fn partition(sample: &mut [[f32; 3]], is_first: impl Fn(&[f32; 3]) -> bool) -> usize {
    sample.sort_unstable_by_key(|c| !is_first(c));
    sample.iter().take_while(|c| is_first(c)).count()
}

/// The axis on which centroids spread most, and the place at which `part` of `parts` end; none where all are equal.
fn median(n: usize, centroid: &dyn Fn(usize) -> [f32; 3], part: usize, parts: usize) -> Option<(usize, usize)> {
    let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
    for i in 0..n {
        let c = centroid(i);
        low = std::array::from_fn(|k| low[k].min(c[k]));
        high = std::array::from_fn(|k| high[k].max(c[k]));
    }
    let extent = |k: usize| f64::from(high[k]) - f64::from(low[k]);
    let axis = (0..3).max_by(|&a, &b| extent(a).total_cmp(&extent(b)))?;
    (extent(axis) > 0.0).then_some((axis, n * part / parts))
}

/// Divides a file into files.
fn on_disk(part: &Part, most: usize, n_files: &mut usize) -> Result<Vec<Part>, TileError> {
    let n_parts = part.n.div_ceil(most as u64).next_power_of_two().clamp(2, MOST_PARTS as u64) as usize;
    let mut n_planes = 0;
    let planes = Planes::of(&mut part.sample()?, n_parts, &mut n_planes);
    let folder = part.path.parent().unwrap_or(Path::new("."));
    let mut spools = vec![];
    for _ in 0..n_planes {
        spools.push(Spool::create(folder.join(format!("part-{n_files}.spool")))?);
        *n_files += 1;
    }
    if n_planes > 1 {
        part.each(&mut |record| spools[planes.part_of(record.centroid())].write(record))?;
    } else {
        // Equal centroids, as far as the sample shows.
        let size = part.n.div_ceil(n_parts as u64);
        for _ in 1..n_parts {
            spools.push(Spool::create(folder.join(format!("part-{n_files}.spool")))?);
            *n_files += 1;
        }
        let mut i = 0;
        part.each(&mut |record| {
            let spool = &mut spools[(i / size) as usize];
            i += 1;
            spool.write(record)
        })?;
    }
    let finish = |spool: Spool| spool.finish().map(|(path, n)| Part { path, n, is_flat: false });
    spools.into_iter().map(finish).collect()
}

/// Divides triangles into tiles of similar numbers.
fn in_memory(
    records: &mut [Record],
    tile: usize,
    write: &mut dyn FnMut(&[Record]) -> Result<(), TileError>,
) -> Result<(), TileError> {
    let n_tiles = records.len().div_ceil(tile);
    if n_tiles <= 1 {
        records.sort_unstable_by_key(|record| record.number);
        return write(records);
    }
    let place = match median(records.len(), &|i| records[i].centroid(), n_tiles / 2, n_tiles) {
        Some((axis, place)) => {
            let order = |a: &Record, b: &Record| {
                a.centroid()[axis].total_cmp(&b.centroid()[axis]).then(a.number.cmp(&b.number))
            };
            records.select_nth_unstable_by(place, order);
            place
        }
        None => {
            records.sort_unstable_by_key(|record| record.number);
            records.len() * (n_tiles / 2) / n_tiles
        }
    };
    let (below, rest) = records.split_at_mut(place);
    in_memory(below, tile, write)?;
    in_memory(rest, tile, write)
}
