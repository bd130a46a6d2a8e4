//! `canted tiles`, and `canted cast` on what it writes: the bytes of `canted cast` on the scene.

use std::{fmt::Write as _, fs};

use canted_fixtures::skip;

use crate::support::{Folder, Random, SMALL};

/// A number from 0 to 1.
fn unit(random: &mut Random) -> f64 {
    f64::from(random.below(1 << 20)) / f64::from(1 << 20)
}

/// A soup as OBJ and as binary STL, and rays.
fn folder() -> Folder {
    let (folder, mut random) = (Folder::new(), Random(5));
    let (mut obj, mut stl, mut vertices, mut faces) = (String::new(), vec![0; 80], vec![], vec![]);
    stl.extend(500_u32.to_le_bytes());
    for i in 0..500_usize {
        let center = [0; 3].map(|_| 10.0 * unit(&mut random) as f32);
        stl.extend([0; 12]);
        for _ in 0..3 {
            let [x, y, z] = center.map(|c| c + unit(&mut random) as f32);
            writeln!(obj, "v {x} {y} {z}").unwrap();
            stl.extend([x, y, z].iter().flat_map(|x| x.to_le_bytes()));
            vertices.extend([x, y, z].iter().flat_map(|x| x.to_be_bytes()));
        }
        // A triangle, and a face with a vertex of the one before.
        for face in [&[3 * i, 3 * i + 1, 3 * i + 2][..], &[3 * i, 3 * i + 1, 3 * i + 2, (3 * i).saturating_sub(1)]] {
            faces.push(face.len() as u8);
            faces.extend(face.iter().flat_map(|&index| (index as u32).to_be_bytes()));
        }
        stl.extend([0; 2]);
        writeln!(obj, "f {} {} {}", 3 * i + 1, 3 * i + 2, 3 * i + 3).unwrap();
    }
    let mut rays = "ox,oy,oz,dx,dy,dz,tmax\n".to_owned();
    for _ in 0..2000 {
        let [ox, oy, oz, dx, dy, dz] = [0; 6].map(|_| unit(&mut random));
        writeln!(rays, "{},{},{},{},{},{},inf", 12.0 * ox, 12.0 * oy, 12.0 * oz, dx - 0.5, dy - 0.5, dz - 0.5).unwrap();
    }
    // Some that meet the few triangles of the small scene.
    for _ in 0..100 {
        writeln!(rays, "{},{},-1,0,0,1,inf", unit(&mut random), unit(&mut random)).unwrap();
    }
    folder.write("soup.obj", obj);
    folder.write("soup.stl", stl);
    let header = "ply\nformat binary_big_endian 1.0\nelement vertex 1500\nproperty float x\nproperty float y\nproperty float z\n\
                  element face 1000\nproperty list uchar int vertex_indices\nend_header\n";
    folder.write("soup.ply", [header.as_bytes(), &vertices, &faces].concat());
    folder.write("small.obj", SMALL);
    folder.write("rays.csv", rays);
    // Two meshes many times: a scene with a top level, in which numbers are those of the files.
    let mut scene = String::new();
    for name in ["soup.obj", "small.obj"] {
        writeln!(scene, "[[assets]]\nname = \"{name}\"\nfile = \"{name}\"").unwrap();
    }
    for i in 0..4 {
        for name in ["soup.obj", "small.obj"] {
            writeln!(scene, "[[instances]]\nasset = \"{name}\"\ntranslation = [{i}, 0.5, 0]").unwrap();
        }
    }
    folder.write("placed.toml", scene);
    folder
}

#[test]
fn a_store_answers_as_its_scene() {
    let folder = folder();
    for (scene, tile) in [
        ("soup.obj", 500),
        ("soup.obj", 60),
        ("soup.stl", 7),
        ("soup.ply", 100),
        ("small.obj", 1),
        ("placed.toml", 100),
    ] {
        folder.run(&format!("tiles {scene} -o store --tile-triangles {tile}")).done();
        for options in ["", "--occluded"] {
            folder.run(&format!("cast {scene} --rays rays.csv --hits scene.csv {options}")).done();
            for memory in ["2G", "10K"] {
                folder.run(&format!("cast store --rays rays.csv --hits store.csv --memory {memory} {options}")).done();
                assert_eq!(folder.text("store.csv"), folder.text("scene.csv"), "{scene} {tile} {options}");
            }
        }
        assert!(folder.text("scene.csv").lines().filter(|line| !line.contains(",-1,")).count() > 1, "{scene}");
    }
}

/// The second scene is numbered on from the first.
#[test]
fn scenes_are_numbered_one_after_another() {
    let folder = folder();
    let report = folder.run("tiles soup.obj small.obj -o store --tile-triangles 100 --json").done().stdout;
    assert!(report.contains("\"triangles\":503") && report.contains("\"tiles\":6"), "{report}");
    folder.write("ray.csv", "0.9,0.1,-1,0,0,1,1.5\n");
    folder.run("cast store --rays ray.csv --hits hit.csv").done();
    assert_eq!(folder.text("hit.csv"), "t,prim,u,v,instance\n1,500,0.8,0.1,1\n".replace("0.8,0.1", &middle(&folder)));
}

/// `u,v` of the ray on the scene alone.
fn middle(folder: &Folder) -> String {
    folder.run("cast small.obj --rays ray.csv --hits alone.csv").done();
    let text = folder.text("alone.csv");
    let row: Vec<&str> = text.lines().nth(1).unwrap().split(',').collect();
    assert_eq!((row[0], row[1]), ("1", "0"));
    format!("{},{}", row[2], row[3])
}

#[test]
fn bad_stores_and_options_are_refused() {
    let folder = folder();
    folder.run("tiles soup.obj -o store --tile-triangles 100").done();
    for command in ["render store -o out.png", "store -o out.png", "stats store", "tiles store -o other"] {
        folder.run(command).refused(&["store: a store of tiles", "canted cast", "the scenes that it was made of"]);
    }
    let tile = folder.path("store").join("000002.bvh");
    let bytes = fs::read(&tile).unwrap();
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 1;
    for (content, words) in [(flipped, ["000002.bvh", "checksum"]), (bytes[..99].to_vec(), ["000002.bvh", "99 bytes"])]
    {
        fs::write(&tile, content).unwrap();
        folder.run("cast store --rays rays.csv --hits hits.csv").refused(&words);
    }
    fs::remove_file(&tile).unwrap();
    folder.run("cast store --rays rays.csv --hits hits.csv").refused(&["000002.bvh", "missing"]);
    fs::remove_file(folder.path("store").join("manifest.json")).unwrap();
    folder.run("cast store --rays rays.csv --hits hits.csv").refused(&["store", "not a store of tiles"]);
    folder.run("tiles soup.obj -o store").refused(&["store", "not a store of tiles", "another name"]);
    folder.run("tiles soup.obj absent.obj -o other").refused(&["absent.obj"]);
    folder.run("tiles soup.obj -o other --memory 1M").refused(&["262144 triangles", "at most 819 triangles"]);
    folder.run("tiles soup.obj -o other --memory 512").refused(&["262144 triangles", "use more memory"]);
    folder.run("tiles soup.obj -o soup.obj").refused(&["soup.obj"]);
    folder.run("cast soup.obj --rays rays.csv --hits hits.csv --memory 1G").refused(&["--memory", "canted tiles"]);
    assert!(!folder.names().iter().any(|name| name.contains("other") || name == "hits.csv"), "{:?}", folder.names());
}

/// A limit of the size of files stands for a full disk: of the spool, then of a tile. The same command goes on when there is room.
#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_named_and_the_command_goes_on() {
    let folder = folder();
    folder.run("tiles soup.obj -o whole --tile-triangles 500").done();
    for kib in [8, 20] {
        let script = format!("trap '' XFSZ; ulimit -f {kib}; exec \"$0\" tiles soup.obj -o store --tile-triangles 500");
        let mut shell = std::process::Command::new("bash");
        shell.current_dir(folder.path(".")).args(["-c", &script, env!("CARGO_BIN_EXE_canted")]);
        let Ok(output) = shell.output() else {
            skip::<()>("a_full_disk_is_named_and_the_command_goes_on", "there is no bash");
            return;
        };
        let errors = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{errors}");
        assert!(errors.contains("store.partial") && errors.contains("too large"), "{errors}");
        assert!(!folder.names().contains(&"store".to_owned()));
    }
    folder.run("tiles soup.obj -o store --tile-triangles 500").done();
    for name in ["000000.bvh", "000000.numbers", "manifest.json"] {
        assert_eq!(
            fs::read(folder.path("store").join(name)).unwrap(),
            fs::read(folder.path("whole").join(name)).unwrap()
        );
    }
    assert!(!folder.names().iter().any(|name| name.contains("partial")), "{:?}", folder.names());
}
