//! `canted cast` against a linear scan over all triangles in `f64`.
//!
//! Coordinates are small integers, so the determinants of the oracle are exact and only the program rounds.

mod oracle;

use crate::{
    gpu::adapter,
    support::{BUILDERS, Folder, rows},
};
use oracle::{By, Judged, Model, judged_rays, model};

const HEADER: &str = "t,prim,u,v,instance";

const N_RAYS: usize = 2000;

fn csv(rays: &[Judged]) -> String {
    let row = |([o, d], _): &Judged| format!("{},{},{},{},{},{},inf\n", o[0], o[1], o[2], d[0], d[1], d[2]);
    "ox,oy,oz,dx,dy,dz,tmax\n".to_owned() + &rays.iter().map(row).collect::<String>()
}

/// Triangles that often occlude each other, and rays of which between a quarter and three quarters hit.
fn model_and_rays(by: By) -> (Model, Vec<Judged>) {
    let model = model(60);
    let rays = judged_rays(&model, N_RAYS, by);
    let n_hits = rays.iter().filter(|(_, answer)| answer.is_some()).count();
    assert!((N_RAYS / 4..N_RAYS * 3 / 4).contains(&n_hits), "{n_hits} of {N_RAYS} rays hit");
    (model, rays)
}

/// A folder with the model and the rays.
fn folder_and_rays(by: By) -> (Folder, Vec<Judged>) {
    let (model, rays) = model_and_rays(by);
    let folder = Folder::new();
    folder.write("model.obj", &model.obj);
    folder.write("rays.csv", csv(&rays));
    (folder, rays)
}

#[track_caller]
fn assert_answers(hits: &[Vec<f64>], rays: &[Judged], what: &str) {
    assert_eq!(hits.len(), rays.len(), "{what}");
    for (hit, (ray, answer)) in hits.iter().zip(rays) {
        let Some((prim, crossing)) = answer else {
            assert_eq!((hit[1], hit[4]), (-1.0, -1.0), "{what}: {ray:?}");
            continue;
        };
        assert_eq!(hit[1], f64::from(u32::try_from(*prim).unwrap()), "{what}: {ray:?}");
        for (got, (want, bound)) in [hit[0], hit[2], hit[3]].iter().zip(crossing.tuv.iter().zip(crossing.bounds)) {
            assert!((got - want).abs() <= bound, "{what}: {ray:?}: {got} is not {want} within {bound}");
        }
    }
}

#[test]
fn hits_match_a_linear_scan() {
    let (folder, rays) = folder_and_rays(By::Cpu);
    for triangles in ["watertight", "moller-trumbore", "baldwin-weber"] {
        folder.run(&format!("cast model.obj --rays rays.csv --hits hits.csv --triangles {triangles}")).done();
        assert_answers(&rows(&folder.text("hits.csv"), HEADER), &rays, triangles);
    }
}

#[test]
fn json_reports_the_number_of_hits() {
    let (folder, rays) = folder_and_rays(By::Cpu);
    let n_hits = rays.iter().filter(|(_, answer)| answer.is_some()).count();
    for options in ["", "--occluded"] {
        let facts =
            folder.run(&format!("cast model.obj --rays rays.csv --hits hits.csv --json {options}")).done().json();
        assert_eq!((&facts["rays"], &facts["hits"]), (&N_RAYS.into(), &n_hits.into()), "{options}: {facts}");
        assert!(facts["trace_seconds"].as_f64().unwrap() > 0.0 && facts["rays_per_second"].as_f64().unwrap() > 0.0);
    }
}

#[test]
fn every_preset_and_builder_matches_a_linear_scan() {
    let (folder, rays) = folder_and_rays(By::Cpu);
    for preset in ["dynamic", "fast", "balanced", "quality"] {
        for builder in BUILDERS {
            let options = format!("--preset {preset} --builder {builder}");
            folder.run(&format!("cast model.obj --rays rays.csv --hits hits.csv {options}")).done();
            assert_answers(&rows(&folder.text("hits.csv"), HEADER), &rays, &options);
        }
    }
}

#[test]
fn a_gpu_matches_a_linear_scan() {
    let Some(_) = adapter("a_gpu_matches_a_linear_scan") else { return };
    let (folder, rays) = folder_and_rays(By::Device);
    // The device builds the BVHs of `lbvh` and `ploc`.
    for (levels, builder) in [("one", "auto"), ("two", "auto"), ("one", "lbvh"), ("two", "ploc")] {
        let options = format!("--levels {levels} --builder {builder} --device gpu");
        let cast = |more: &str| -> Vec<Vec<f64>> {
            folder.run(&format!("cast model.obj --rays rays.csv --hits hits.csv {options} {more}")).done();
            rows(&folder.text("hits.csv"), HEADER)
        };
        assert_answers(&cast(""), &rays, &options);
        for (hit, (ray, answer)) in cast("--occluded").iter().zip(&rays) {
            let expected = if answer.is_some() { [0.0; 5] } else { [f64::INFINITY, -1.0, 0.0, 0.0, -1.0] };
            assert_eq!(hit[..], expected, "{options}: {ray:?}");
        }
    }
}

#[test]
fn the_oracle_detects_two_swapped_primitives() {
    let (mut model, rays) = model_and_rays(By::Cpu);
    let hit = rays.iter().find_map(|(_, answer)| answer.as_ref()).unwrap().0;
    let other = (hit + 1) % model.triangles.len();
    model.triangles.swap(hit, other);
    let swapped = judged_rays(&model, N_RAYS, By::Cpu);
    let prim = |(_, answer): &Judged| answer.as_ref().map(|(prim, _)| *prim);
    assert_ne!(rays.iter().map(prim).collect::<Vec<_>>(), swapped.iter().map(prim).collect::<Vec<_>>());
}

#[test]
fn hits_are_the_same_for_all_structures() {
    let (folder, _) = folder_and_rays(By::Cpu);
    for triangles in ["watertight", "moller-trumbore", "baldwin-weber"] {
        let mut first: Option<String> = None;
        for levels in ["auto", "one", "two"] {
            for (builder, volumes) in [
                ("lbvh", "auto"),
                ("lbvh", "aabb"),
                ("lbvh", "pca-unbounded"),
                ("lbvh", "pca-bounded"),
                ("lbvh", "quaternion"),
                ("lbvh", "combined"),
                ("lbvh", "dop"),
                #[cfg(feature = "baseline")]
                ("obvhs", "auto"),
                #[cfg(feature = "baseline")]
                ("obvhs", "dop"),
                ("auto", "auto"),
                ("auto", "dop"),
                ("sah", "auto"),
                ("sah", "aabb"),
                ("sbvh", "auto"),
                ("sbvh", "aabb"),
                ("sbvh", "combined"),
                ("auto --preset fast", "auto"),
                ("auto --preset quality", "auto"),
                ("auto --preset dynamic", "auto"),
                ("auto --accel bvh2", "auto"),
                ("auto --accel bih", "auto"),
                ("auto --accel kdtree", "auto"),
            ] {
                let options =
                    format!("--triangles {triangles} --levels {levels} --builder {builder} --volumes {volumes}");
                folder.run(&format!("cast model.obj --rays rays.csv --hits hits.csv {options}")).done();
                let hits = folder.text("hits.csv");
                assert_eq!(first.get_or_insert_with(|| hits.clone()), &hits, "{options}");
            }
        }
    }
}

#[test]
fn binary_files_contain_the_same_numbers_as_text_files() {
    let (folder, rays) = folder_and_rays(By::Cpu);
    let numbers = rays.iter().flat_map(|(ray, _)| {
        ray.iter().flatten().map(|&x| f32::from(i16::try_from(x).unwrap())).chain([f32::INFINITY])
    });
    folder.write("rays.bin", numbers.flat_map(f32::to_le_bytes).collect::<Vec<u8>>());
    for rays in ["rays.csv", "rays.bin"] {
        folder.run(&format!("cast model.obj --rays {rays} --hits hits.csv")).done();
        folder.run(&format!("cast model.obj --rays {rays} --hits hits.bin")).done();
        let text: Vec<Vec<f32>> = rows(&folder.text("hits.csv"), HEADER);
        let bytes = folder.bytes("hits.bin");
        assert_eq!(bytes.len(), 16 * text.len());
        for (row, chunk) in text.iter().zip(bytes.chunks_exact(16)) {
            let word = |k: usize| <[u8; 4]>::try_from(&chunk[4 * k..4 * k + 4]).unwrap();
            let float = |k: usize| f32::from_le_bytes(word(k));
            assert_eq!([row[0], row[2], row[3]], [float(0), float(2), float(3)]);
            assert_eq!(row[1].to_string(), i32::from_le_bytes(word(1)).to_string());
        }
    }
}

#[test]
fn the_interval_is_closed_and_t_is_in_units_of_the_direction() {
    let folder = Folder::with_small();
    // From z = 5, the roof at z = 1 occludes the floor at z = 0.
    let row = |dz: f32, t_max: f32| format!("0.25,0.25,5,0,0,{dz},{t_max}\n");
    let below = f32::from_bits(4.0f32.to_bits() - 1);
    let rays =
        [(-1.0, 9.0), (-2.0, 9.0), (-0.5, 9.0), (-1.0, 4.0), (-1.0, below), (-2.0, 2.0), (1.0, 9.0), (-1.0, -1.0)];
    folder.write("rays.csv", rays.map(|(dz, t_max)| row(dz, t_max)).concat());
    for triangles in ["watertight", "moller-trumbore", "baldwin-weber"] {
        folder.run(&format!("cast small.obj --rays rays.csv --hits hits.csv --triangles {triangles}")).done();
        let hits: Vec<Vec<f32>> = rows(&folder.text("hits.csv"), HEADER);
        assert_eq!(hits.iter().map(|hit| hit[1]).collect::<Vec<_>>(), [2.0, 2.0, 2.0, 2.0, -1.0, 2.0, -1.0, -1.0]);
        assert_eq!([0, 1, 2, 3, 5].map(|i: usize| hits[i][0]), [4.0, 2.0, 8.0, 4.0, 2.0], "{triangles}");
        folder.run(&format!("cast small.obj --rays rays.csv --hits any.csv --occluded --triangles {triangles}")).done();
        let any: Vec<Vec<f32>> = rows(&folder.text("any.csv"), HEADER);
        let is_hit = |hits: &[Vec<f32>]| hits.iter().map(|hit| hit[1] >= 0.0).collect::<Vec<_>>();
        assert_eq!(is_hit(&any), is_hit(&hits), "{triangles}");
    }
}

#[test]
fn degenerate_faces_are_numbered_too() {
    let folder = Folder::new();
    folder.write(
        "flat.obj",
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 0 1 1\nf 1 1 2\nf 1 2 3\nf 4 5 4\nf 4 5 6\n",
    );
    folder.write("rays.csv", "0.25,0.25,5,0,0,-1,9\n0.25,0.25,-5,0,0,1,9\n");
    folder.run("cast flat.obj --rays rays.csv --hits hits.csv").done();
    let hits: Vec<Vec<f32>> = rows(&folder.text("hits.csv"), HEADER);
    assert_eq!(hits.iter().map(|hit| hit[1]).collect::<Vec<_>>(), [3.0, 1.0]);
}

#[test]
fn invalid_rays_are_rejected_with_their_line() {
    let folder = Folder::with_small();
    for (rays, words) in [
        ("0,0,1,0,0,-1,9\n0,0,1,0,0,-1\n", ["line 2", "found 6"]),
        ("0,0,1,0,0,down,9\n", ["line 1", "down"]),
        ("0,0,nan,0,0,-1,9\n", ["line 1", "finite"]),
        ("0,0,1,0,0,-1,nan\n", ["line 1", "tmax"]),
    ] {
        folder.write("rays.csv", rays);
        folder.run("cast small.obj --rays rays.csv --hits hits.csv").refused(&[&["rays.csv"], &words[..]].concat());
    }
    folder.write("rays.bin", [0; 27]);
    folder.run("cast small.obj --rays rays.bin --hits hits.csv").refused(&["rays.bin", "27 bytes"]);
    folder.write("rays.csv", "");
    folder.run("cast small.obj --rays rays.csv --hits hits.csv").done();
    assert_eq!(folder.text("hits.csv"), format!("{HEADER}\n"));
}
