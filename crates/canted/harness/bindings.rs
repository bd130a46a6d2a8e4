//! The library's side of comparisons with bindings: all queries bit for bit, and the time of one.
//!
//! `bindings INPUT OUTPUT` answers all queries; both files are 32-bit words, least byte first. Input: numbers of vertices, triangles,
//! rays and points; vertices; indices; rays (origin, direction, `t_min`, `t_max`); points. Output: the closest hits of all rays;
//! whether they are occluded; the number of all hits, and these with their rays; the same for crossings; whether points are inside;
//! the nearest point of each (distance, triangle, position); signed distances. A hit is `t, u, v`, triangle, front side; a miss is
//! `inf, 0, 0, -1, 0`.
//!
//! `bindings INPUT` casts all rays once on all threads for each line of standard input, and prints the seconds of wall time that
//! this took and the number of rays that hit.
#![expect(clippy::print_stdout, reason = "the program that measures reads the results")]
use std::{env, error::Error, fs, io, time::Instant};

use canted::distance::NearestPoint;
use canted::{Crossings, Hit, Intersect, PrimId, Ray, Side, TriangleBvh};

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = env::args().skip(1).collect();
    let (input, output) = match &arguments[..] {
        [input] => (input, None),
        [input, output] => (input, Some(output)),
        _ => return Err("usage: bindings INPUT [OUTPUT]".into()),
    };
    let bytes = fs::read(input)?;
    let words: Vec<u32> = bytes.as_chunks().0.iter().map(|&word| u32::from_le_bytes(word)).collect();
    let Input { vertices, triangles, rays, points } =
        Input::read(&words).ok_or_else(|| format!("{input}: the file ends too early"))?;
    let bvh = TriangleBvh::build(&vertices, triangles)?;
    let Some(output) = output else { return rate(&bvh, &rays) };
    let answers = answers(&bvh, &rays, &points);
    fs::write(output, answers.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>())?;
    Ok(())
}

/// What is queried.
struct Input<'a> {
    vertices: Vec<[f32; 3]>,
    triangles: &'a [[u32; 3]],
    rays: Vec<Ray>,
    points: Vec<[f32; 3]>,
}

impl<'a> Input<'a> {
    /// `None` where the words end too early.
    fn read(words: &'a [u32]) -> Option<Self> {
        let (&[n_vertices, n_triangles, n_rays, n_points], rest) = words.split_first_chunk()?;
        let (vertices, rest) = rest.split_at_checked(3 * n_vertices as usize)?;
        let (triangles, rest) = rest.split_at_checked(3 * n_triangles as usize)?;
        let (rays, points) = rest.split_at_checked(8 * n_rays as usize)?;
        let floats = |words: &[u32]| words.as_chunks().0.iter().map(|v: &[u32; 3]| v.map(f32::from_bits)).collect();
        Some(Self {
            vertices: floats(vertices),
            triangles: triangles.as_chunks().0,
            rays: rays.as_chunks().0.iter().map(ray).collect(),
            points: floats(points.get(..3 * n_points as usize)?),
        })
    }
}

fn rate(bvh: &TriangleBvh, rays: &[Ray]) -> Result<(), Box<dyn Error>> {
    let mut hits = vec![None; rays.len()];
    for line in io::stdin().lines() {
        line?;
        let start = Instant::now();
        bvh.par_closest_hits(rays, &mut hits);
        let seconds = start.elapsed().as_secs_f64();
        println!("{seconds} {}", hits.iter().flatten().count());
    }
    Ok(())
}

fn ray(words: &[u32; 8]) -> Ray {
    let [ox, oy, oz, dx, dy, dz, t_min, t_max] = words.map(f32::from_bits);
    Ray::new([ox, oy, oz], [dx, dy, dz]).between(t_min, t_max)
}

fn answers(bvh: &TriangleBvh, rays: &[Ray], points: &[[f32; 3]]) -> Vec<u32> {
    let mut out = vec![];
    let mut closest = vec![None; rays.len()];
    bvh.par_closest_hits(rays, &mut closest);
    closest.iter().for_each(|hit| out.extend(row(hit.as_ref())));
    let mut occluded = vec![false; rays.len()];
    bvh.par_occluded_many(rays, &mut occluded);
    out.extend(occluded.iter().map(|&occluded| u32::from(occluded)));
    lists(&mut out, rays, |ray, hits| bvh.all_hits(ray, hits));
    lists(&mut out, rays, |ray, hits| bvh.crossings(ray, hits));
    out.extend(points.iter().map(|&point| u32::from(bvh.contains(point))));
    let none = NearestPoint { distance: f32::INFINITY, position: [f32::NAN; 3], primitive: PrimId(u32::MAX) };
    for &point in points {
        let nearest = bvh.nearest_point(point, f32::INFINITY).unwrap_or(none);
        out.extend([nearest.distance.to_bits(), nearest.primitive.0]);
        out.extend(nearest.position.map(f32::to_bits));
    }
    out.extend(points.iter().map(|&point| bvh.signed_distance(point).to_bits()));
    out
}

fn row(hit: Option<&Hit>) -> [u32; 5] {
    let miss = [f32::INFINITY.to_bits(), 0, 0, u32::MAX, 0];
    hit.map_or(miss, |hit| {
        [hit.t.to_bits(), hit.u.to_bits(), hit.v.to_bits(), hit.primitive.0, u32::from(hit.side == Side::Front)]
    })
}

fn lists(out: &mut Vec<u32>, rays: &[Ray], mut query: impl FnMut(&Ray, &mut Vec<Hit>)) {
    let (place, mut n, mut hits) = (out.len(), 0, vec![]);
    out.push(0);
    for (i, ray) in (0..).zip(rays) {
        query(ray, &mut hits);
        n += hits.len();
        hits.iter().for_each(|hit| {
            out.push(i);
            out.extend(row(Some(hit)));
        });
    }
    out[place] = u32::try_from(n).expect("fewer hits than words");
}
