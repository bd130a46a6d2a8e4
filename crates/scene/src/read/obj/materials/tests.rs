//! Libraries and images in a folder, with an image outside that must never be read.

use std::fs;

use super::*;
use crate::{Encoding, TextureRef, Wrap, read, read_with};

/// A folder with images, `m.mtl`, and `model.obj`, which uses each of `names` once.
struct Case {
    temp: tempfile::TempDir,
}

impl Case {
    fn new(mtl: impl AsRef<[u8]>, names: &[&str]) -> Self {
        let temp = tempfile::tempdir().unwrap();
        let case = Self { temp };
        fs::create_dir(case.path("")).unwrap();
        let faces: String = names.iter().map(|name| format!("usemtl {name}\nf 1/1 2/2 3/1\n")).collect();
        let obj = format!("mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0.25 0.5\nvt 0.75 0.5\n{faces}");
        fs::write(case.path("model.obj"), obj).unwrap();
        fs::write(case.path("m.mtl"), mtl).unwrap();
        let rgb = crate::read::testing::encoded(::image::ImageFormat::Png);
        for file in ["rgb.png", "two words.png", "sub/deep.png", "../outside.png"] {
            fs::create_dir_all(case.path(file).parent().unwrap()).unwrap();
            fs::write(case.path(file), &rgb).unwrap();
        }
        case
    }

    fn path(&self, file: &str) -> PathBuf {
        self.temp.path().join("scene").join(file)
    }

    fn read(&self) -> Scene {
        read(&self.path("model.obj")).unwrap()
    }
}

/// The material of a library with these lines, and its warnings.
fn only(lines: &str) -> (Material, Vec<String>) {
    let mut scene = Case::new(format!("newmtl a\n{lines}"), &["a"]).read();
    (scene.materials.remove(0), scene.warnings)
}

#[test]
fn reads_colors_and_reports_invalid_ones() {
    let plain = Material::default().base_color;
    for (line, albedo, warning) in [
        ("Kd 0.1 0.2 0.3", [0.1, 0.2, 0.3], ""),
        ("Kd 0.5", [0.5; 3], ""),
        ("Kd 0.5 0.25", plain, "ignoring Kd '0.5 0.25': expected 1 or 3 numbers"),
        ("Kd", plain, "ignoring Kd '': expected 1 or 3 numbers"),
        ("Kd r g b", plain, "ignoring Kd 'r g b': expected 1 or 3 numbers"),
        ("Kd nan 0 0", plain, "ignoring Kd 'nan 0 0': expected numbers"),
        ("Kd -1 0.5 5", [0.0, 0.5, 1.0], "clamping Kd '-1 0.5 5' to the valid range"),
        ("Kd spectral x.rfl", plain, "ignoring Kd 'spectral x.rfl': expected 1 or 3 numbers"),
        ("d -halo 0.5", plain, ""),
        ("d x", plain, "ignoring d 'x': expected a number"),
        ("Ni nan", plain, "ignoring Ni 'nan': expected a number"),
        ("Tr 2", plain, "clamping Tr '2' to the valid range|a fully transparent material is not seen: material 'a'"),
        ("Tr 0\nd 1", plain, ""),
        ("Ns 1e30\nKs 1 1 1\nfoo", plain, ""),
    ] {
        let (material, warnings) = only(line);
        assert_eq!(material.base_color, albedo, "{line}");
        let want = if warning.is_empty() { String::new() } else { format!("m.mtl: line 2: material 'a': {warning}") };
        assert_eq!(warnings.join("|"), want, "{line}");
    }
    for (stated, kept, n_warnings) in [("1000", 1000.0, 0), ("1e20", Material::MAX_IOR, 1), ("0.5", 1.0, 1)] {
        let (material, warnings) = only(&format!("illum 4\nNi {stated}"));
        assert_eq!((material.ior, warnings.len()), (kept, n_warnings), "{stated}: {warnings:?}");
    }
    // Of MeshLab.
    let (material, warnings) = only("Tr 1\nillum 2");
    assert_eq!(
        (material.alpha, &warnings[..]),
        (1.0, &["reading Tr 1 as opaque, as MeshLab writes it: material 'a'".to_owned()][..])
    );
    assert!(only("Tr 1").0.is_invisible());
    assert_eq!(only("Ke 17 12 4").0.emission, [17.0, 12.0, 4.0]);
    assert_eq!(only("Ke -1 inf 4").0.emission, [0.0, f32::MAX, 4.0]);
    assert_eq!(only("Kd 0 0 0\nnewmtl a\nKd 1 1 1").0.base_color, [1.0; 3], "the last definition wins");
}

#[test]
fn unsupported_keys_are_reported() {
    for (lines, keys) in [
        ("map_Ks a.png\nmap_Ns a.png\nrefl -type sphere a.png", &["map_Ns", "refl", "map_Ks"][..]),
        ("disp a.png\ndecal a.png", &["disp", "decal"]),
        ("Pc 0.5\nPcr 0.1\nPs 1\nmap_Ps a.png\naniso 0.5\nanisor 0.1", &["Pc", "Ps", "map_Ps", "aniso"]),
        // Blender's defaults are not reported.
        ("Pc 0.000000\nPcr 0.030000\nPs 0\naniso 0.0 \nanisor 0", &[]),
        ("Tf 0.5 1 1", &["Tf"]),
        ("Tf 1 1 1", &[]),
        ("Tf 0 0 0", &[]),
        ("illum 7\nTf 0.5 1 1", &[]),
        ("Ka 1 1 1\nmap_Ka a.png\nsharpness 60\nmap_aat on", &[]),
    ] {
        let warning = |key: &&str| format!("ignoring {key} (not supported): material 'a'");
        assert_eq!(only(lines).1, keys.iter().map(warning).collect::<Vec<_>>(), "{lines}");
    }
    let two = Case::new("newmtl a\ndisp q.png\nnewmtl b\ndisp q.png", &["a", "b"]).read();
    assert_eq!(two.warnings, ["ignoring disp (not supported): material 'a' and 1 more"]);
}

#[test]
fn finds_images_inside_the_folder() {
    for file in [
        "rgb.png",
        "two words.png",
        "sub\\deep.png",
        "./sub/../rgb.png",
        "-s 1 1 1 -o 0 -clamp off rgb.png",
        "RGB.png",
        "Two Words.PNG",
        "\"rgb.png\"",
        "\"two words.png\" -bm 1",
        "'two words.png'",
        "-s 1 1 \"two words.png\"",
        "two words.png -bm 0.5 -blendu on",
        "rgb.png -TEXRES 512",
        "C:\\Users\\someone\\maps\\rgb.png",
        "/home/someone/sub/Deep.png",
        "maps/two words.png -clamp off",
    ] {
        let (material, warnings) = only(&format!("map_Kd {file}\nd 0.5\nmap_d {file}"));
        assert_eq!(warnings, [""; 0], "{file}");
        assert_eq!(material.base_color, [1.0; 3]);
        let ids = [material.base_color_texture, material.alpha_texture].map(|texture| texture.unwrap().texture);
        assert_eq!(ids, [TextureId(0), TextureId(1)]);
    }
}

#[test]
fn the_specular_map_colors_mirrors() {
    let (mirror, warnings) = only("illum 3\nKd 0 0 0\nKs 0.5 0.25 1\nmap_Kd two words.png\nmap_Ks rgb.png");
    assert_eq!((warnings, mirror.base_color, mirror.metallic), (Vec::new(), [0.5, 0.25, 1.0], 1.0));
    assert!(mirror.base_color_texture.is_some());
    assert_eq!(only("illum 5\nKd 0 0 0\nmap_Ks rgb.png").0.base_color, [1.0; 3], "not scaled without Ks");
    let textures = Case::new("newmtl a\nillum 3\nmap_Kd two words.png\nmap_Ks rgb.png", &["a"]).read().textures;
    assert_eq!(textures.iter().map(|texture| &texture.name[..]).collect::<Vec<_>>(), ["rgb.png"]);
}

#[test]
fn images_are_decoded_once_per_use() {
    let mtl =
        "newmtl a\nmap_Kd rgb.png\nnewmtl b\nmap_Kd ./rgb.png\nmap_d rgb.png\nnewmtl c\nnewmtl unused\nmap_Kd no.png";
    let scene = Case::new(mtl, &["a", "b", "c"]).read();
    assert_eq!(scene.warnings, [""; 0]);
    let id = |texture: Option<TextureRef>| texture.map(|texture| texture.texture);
    let used: Vec<_> = scene.materials.iter().map(|m| (id(m.base_color_texture), id(m.alpha_texture))).collect();
    let (image, mask) = (Some(TextureId(0)), Some(TextureId(1)));
    assert_eq!(used, [(image, None), (image, mask), (None, None)]);
    assert_eq!(scene.textures[0].texels[6], [40, 80, 200, 255]);
    assert_eq!(scene.textures[1].texels[6], [255, 255, 255, 80], "0.2126 * 40 + 0.7152 * 80 + 0.0722 * 200 = 80.2");
    assert_eq!(scene.textures[0].wrap, [Wrap::Repeat; 2]);
    let has_uvs: Vec<bool> = scene.meshes.iter().map(|mesh| mesh.uvs.is_some()).collect();
    assert_eq!(has_uvs, [true, true, false], "only if the material needs them");
    assert_eq!(scene.meshes[0].uvs.as_deref().unwrap(), [[0.25, 0.5], [0.75, 0.5], [0.25, 0.5]]);
}

#[test]
fn reads_emission_and_normal_maps() {
    let mtl = "newmtl a\nmap_Kd rgb.png\nmap_Ke rgb.png\nnorm rgb.png\nnewmtl b\nKe 0 0 0\nmap_Ke rgb.png\n\
               newmtl c\nKe 2 1 0\nmap_Ke rgb.png\nnewmtl d\nmap_Ke no.png";
    let scene = Case::new(mtl, &["a", "b", "c", "d"]).read();
    let [a, b, c, d] = &scene.materials[..] else { panic!("four materials") };
    assert_eq!(scene.textures.iter().map(|t| t.encoding).collect::<Vec<_>>(), [Encoding::Srgb, Encoding::Linear]);
    let texture = |id| Some(TextureRef::new(TextureId(id)));
    assert_eq!((a.base_color_texture, a.emission_texture, a.normal_texture), (texture(0), texture(0), texture(1)));
    assert_eq!((a.emission, b.emission, c.emission, d.emission), ([1.0; 3], [0.0; 3], [2.0, 1.0, 0.0], [0.0; 3]));
    assert_eq!((b.emission_texture, c.emission_texture, d.emission_texture), (None, texture(0), None));
    assert_eq!(scene.warnings.len(), 1, "the missing file: {:?}", scene.warnings);
}

#[test]
fn unreadable_images_are_skipped() {
    let skipping = "skipping texture 'FILE' of material 'a': ";
    for (file, reason) in [
        ("../outside.png", "the path is outside the folder of the scene; --allow-parent permits it"),
        ("sub/../../outside.png", "the path is outside the folder of the scene; --allow-parent permits it"),
        ("..\\outside.png", "the path is outside the folder of the scene; --allow-parent permits it"),
        ("/etc/hostname", "the path is outside the folder of the scene"),
        ("C:\\none.png", "the path is outside the folder of the scene"),
        ("sub", "not a regular file"),
        ("model.obj", "unsupported image format (expected PNG, JPEG, BMP, TGA, TIFF, WebP or KTX2)"),
    ] {
        let (material, warnings) = only(&format!("Kd 0.5 0.5 0.5\nmap_Kd {file}"));
        assert_eq!(warnings, [skipping.replace("FILE", file) + reason]);
        assert_eq!((material.base_color, material.base_color_texture), ([0.5; 3], None));
    }
    assert_eq!(only("map_Kd").1, ["m.mtl: line 2: material 'a': ignoring map_Kd: no file name"]);
    assert_eq!(only("map_Kd -s 1 1 1").1, ["m.mtl: line 2: material 'a': ignoring map_Kd: no file name"]);
    assert!(only("map_Kd no.png").1[0].starts_with(&skipping.replace("FILE", "no.png")));
}

#[test]
fn applies_texture_options() {
    let mtl = "newmtl a\nmap_Kd -s 2 4 1 -o 0.5 -clamp on rgb.png\nmap_d -s 2 rgb.png\nnewmtl b\nmap_Kd rgb.png\n\
               norm -bm 0.5 rgb.png\nnewmtl c\nmap_Kd -clamp on -o 1 rgb.png";
    let scene = Case::new(mtl, &["a", "b", "c"]).read();
    assert_eq!(scene.warnings, [""; 0]);
    let [a, b, c] = &scene.materials[..] else { panic!("three materials") };
    let rows = |texture: Option<TextureRef>| texture.unwrap().texture_from_mesh.rows;
    assert_eq!(rows(a.base_color_texture), [[2.0, 0.0, 0.5], [0.0, 4.0, 0.0]]);
    assert_eq!(rows(a.alpha_texture), [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
    let wrap = |texture: Option<TextureRef>| scene.textures[texture.unwrap().texture.0 as usize].wrap;
    let wraps = [a.base_color_texture, a.alpha_texture, b.base_color_texture].map(wrap);
    assert_eq!(wraps, [[Wrap::Clamp; 2], [Wrap::Repeat; 2], [Wrap::Repeat; 2]]);
    assert_eq!(b.base_color_texture, b.base_color_texture.map(|texture| TextureRef::new(texture.texture)));
    assert_eq!((a.normal_scale, b.normal_scale), (1.0, 0.5));
    let texture = |material: &Material| material.base_color_texture.unwrap().texture;
    assert!(texture(a) == texture(c) && texture(a) != texture(b), "one texture per wrap mode");
}

#[test]
fn unsupported_texture_options_are_reported() {
    let (material, warnings) = only("map_Kd -mm 0.1 2 -t 1 1 1 -s x rgb.png\nmap_d -mm 0 1 rgb.png");
    assert_eq!(material.base_color_texture, Some(TextureRef::new(TextureId(0))));
    assert_eq!(warnings, ["m.mtl: line 2: material 'a': ignoring options of map_Kd: -mm, -t, -s"]);
}

#[test]
fn reads_several_libraries_with_spaces_or_missing() {
    let case = Case::new("newmtl a\nKd 1 0 0", &["a", "b", "nobody"]);
    fs::write(case.path("two words.mtl"), "newmtl b\nKd 0 1 0").unwrap();
    let obj = fs::read_to_string(case.path("model.obj")).unwrap();
    let with = |statement: &str| {
        fs::write(case.path("model.obj"), obj.replace("mtllib m.mtl", statement)).unwrap();
        let scene = case.read();
        (scene.materials.iter().map(|material| material.base_color).collect::<Vec<_>>(), scene.warnings)
    };
    let (red, green, gray) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], Material::default().base_color);
    let nobody = "material 'nobody' not found in any library; using the default material";
    assert_eq!(with("mtllib m.mtl\nmtllib two words.mtl"), (vec![red, green, gray], vec![nobody.to_owned()]));
    fs::rename(case.path("two words.mtl"), case.path("b.mtl")).unwrap();
    assert_eq!(with("mtllib m.mtl b.mtl"), (vec![red, green, gray], vec![nobody.to_owned()]));
    let twice = with("mtllib m.mtl\nmtllib ./m.mtl b.mtl m.mtl\nmtllib no.mtl\nmtllib no.mtl").1;
    assert_eq!(twice.len(), 2, "each file is read or reported once: {twice:?}");
    let (albedos, warnings) = with("mtllib no.mtl");
    assert_eq!((albedos, warnings.len()), (vec![gray; 3], 4));
    assert!(warnings[0].starts_with("cannot read material library 'no.mtl': "), "{warnings:?}");
    let (_, warnings) = with("mtllib ../outside.png");
    assert_eq!(
        warnings[0],
        "cannot read material library '../outside.png': the path is outside the folder of the scene; --allow-parent permits it"
    );
}

#[test]
fn missing_images_are_reported_once() {
    let case = Case::new("newmtl a\nmap_Kd no.png\nnewmtl b\nmap_Kd none.png\nmap_d ../outside.png", &["a", "b"]);
    let warnings = case.read().warnings;
    assert!(warnings[0].starts_with("skipping texture 'no.png' of material 'a': "), "{warnings:?}");
    assert!(warnings[0].ends_with(", and 1 more") && warnings.len() == 2, "{warnings:?}");

    let options = ReadOptions { allow_parent: true, ..ReadOptions::default() };
    let permitted = read_with(&case.path("model.obj"), &options).unwrap();
    assert!(permitted.materials[1].alpha_texture.is_some());
    let options = ReadOptions { texture_paths: vec![case.path("none")], ..ReadOptions::default() };
    let error = read_with(&case.path("model.obj"), &options).unwrap_err().to_string();
    assert!(error.contains("none: cannot read file: "), "{error}");
    let options = ReadOptions { texture_paths: vec![case.path("rgb.png")], ..ReadOptions::default() };
    assert!(read_with(&case.path("model.obj"), &options).is_err(), "not a folder");
}

#[test]
fn keywords_are_read_in_any_case() {
    let stated = "Kd 0.1 0.2 0.3\nKe 1 2 3\nNi 1.25\nPr 0.5\nPm 0.25\nd 0.5\nmap_Kd rgb.png\nmap_Ke rgb.png\n\
                  map_Bump -bm 0.5 rgb.png\nmap_Pr rgb.png\nmap_Pm rgb.png\nmap_D rgb.png\ndisp rgb.png";
    let want = only(stated);
    assert_eq!(want.1, ["ignoring disp (not supported): material 'a'"]);
    for other in [stated.to_lowercase(), stated.to_uppercase().replace("RGB.PNG", "rgb.png")] {
        assert_eq!(only(&other), want, "{other}");
    }
    let shouted = Case::new("NEWMTL a\rKD 1 0 0\rNewMtl b\rkd 0 1 0\r", &["a", "b"]).read();
    assert_eq!(shouted.warnings, [""; 0]);
    assert_eq!([shouted.materials[0].base_color, shouted.materials[1].base_color], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
}

fn material_of(source: MtlMaterial) -> Material {
    surface(String::new(), &source)
}

#[test]
fn exporter_defaults_are_lambertian() {
    let source = MtlMaterial {
        base_color: Some([0.5; 3]),
        specular: Some([0.5; 3]),
        shininess: Some(250.0),
        illumination: Some(2),
        ior: Some(1.45),
        opacity: Some(1.0),
        ..MtlMaterial::default()
    };
    assert_eq!(material_of(source), Material { base_color: [0.5; 3], ..Material::default() });
}

#[test]
fn converts_mirrors_metals_and_glass() {
    let shiny = |base_color| Material { base_color, roughness: 0.0, specular: 1.0, ..Material::default() };
    let mirror = MtlMaterial { illumination: Some(3), specular: Some([0.9, 0.8, 0.7]), ..MtlMaterial::default() };
    assert_eq!(material_of(mirror.clone()), Material { metallic: 1.0, ..shiny([0.9, 0.8, 0.7]) });
    let metal = MtlMaterial { base_color: Some([1.0, 0.5, 0.0]), metallic: Some(0.75), ..mirror };
    assert_eq!(material_of(metal), Material { metallic: 0.75, roughness: 1.0, ..shiny([1.0, 0.5, 0.0]) });
    let (ior, opacity, base_color) = (Some(1.25), Some(0.0), Some([0.0; 3]));
    for illumination in [4, 6, 7, 9].map(Some) {
        let glass = MtlMaterial { illumination, ior, opacity, base_color, ..MtlMaterial::default() };
        assert_eq!(material_of(glass), Material { transmission: 1.0, ior: 1.25, ..shiny([1.0; 3]) });
    }
}

#[test]
fn roughness_falls_back_to_shininess() {
    let with = |roughness, shininess| {
        material_of(MtlMaterial { metallic: Some(0.0), roughness, shininess, ..MtlMaterial::default() }).roughness
    };
    assert_eq!(with(Some(0.25), Some(10.0)), 0.25);
    for (shininess, want) in [(None, 1.0), (Some(0.0), 1.0), (Some(250.0), 0.5), (Some(1e30), 0.0)] {
        assert_eq!(with(None, shininess), want);
    }
}

#[test]
fn opacity_takes_precedence_over_transparency() {
    let with = |opacity, transparency| {
        let material = material_of(MtlMaterial { opacity, transparency, ..MtlMaterial::default() });
        (material.alpha, material.alpha_mode)
    };
    assert_eq!(with(Some(0.25), None), (0.25, AlphaMode::Blend));
    assert_eq!(with(None, Some(0.25)), (0.75, AlphaMode::Blend));
    assert_eq!(with(Some(1.0), Some(1.0)), (1.0, AlphaMode::Opaque));
    assert_eq!(with(None, Some(0.0)), (1.0, AlphaMode::Opaque));
}

fn map_of(options: &str) -> (Map, Vec<&'static str>) {
    let rest = format!("{options} two words.png");
    let line = Line { number: 1, keyword: b"map_Kd", rest: rest.trim_ascii().as_bytes() };
    let (map, unsupported) = read_map(&line).unwrap();
    assert_eq!(map.file, "two words.png", "{options}");
    (map, unsupported)
}

#[test]
fn applies_scale_before_offset() {
    let looked_up = |options: &str| {
        let (map, unsupported) = map_of(options);
        assert_eq!(unsupported, [""; 0], "{options}");
        map.texture_ref(TextureId(0)).texture_from_mesh.point([0.25, 0.5])
    };
    for (options, want) in [
        ("", [0.25, 0.5]),
        ("-s 2", [0.5, 0.5]),
        ("-s 2 4", [0.5, 2.0]),
        ("-s 2 4 8 -o 1 -2 3", [1.5, 0.0]),
        ("-o 0.5", [0.75, 0.5]),
        ("-o 0 0.125 -s -1 1 1", [-0.25, 0.625]),
        ("-s 3 -s 2 -texres 512 -type sphere", [0.5, 0.5]),
    ] {
        assert_eq!(looked_up(options), want, "{options}");
    }
}

#[test]
fn reads_options_after_the_name() {
    let read = |rest: &str| {
        let (map, unsupported) = read_map(&Line { number: 1, keyword: b"map_Kd", rest: rest.as_bytes() }).unwrap();
        (map.file.clone(), map.scale, map.strength, map.is_clamped, unsupported)
    };
    let plain = |name: &str| (name.to_owned(), [1.0; 2], 1.0, false, Vec::new());
    assert_eq!(read("a b.png -bm 0.5 -s 2 3 -clamp on"), ("a b.png".to_owned(), [2.0, 3.0], 0.5, true, Vec::new()));
    assert_eq!(read("-s 2 a.png -bm 0.5"), ("a.png".to_owned(), [2.0, 1.0], 0.5, false, Vec::new()));
    assert_eq!(read("\"a -s 2.png\" -mm 0.5 1").4, ["-mm"]);
    for name in ["a -s b.png", "a -bm 1.png", "a - b.png", "a -x 1", "a-s 1 1.png", "a -bm", "a.png -clamp maybe"] {
        assert_eq!(read(name), plain(name));
    }
}

#[test]
fn reports_unsupported_options() {
    for neutral in ["-t 0", "-t 0 0 0.0", "-mm 0 1", "-mm 0.0", "-cc off", "-blendu on -blendv on", "-imfchan l"] {
        assert_eq!(map_of(neutral).1, [""; 0], "{neutral}");
    }
    for (options, names) in [
        ("-t 1", &["-t"][..]),
        ("-mm 0 2 -mm 1 1", &["-mm"]),
        ("-s nan 1", &["-s"]),
        ("-o 1 inf -clamp maybe", &["-o", "-clamp"]),
        ("-bm strong", &["-bm"]),
        ("-imfchan z -blendu off -boost 3 -cc on", &["-imfchan", "-blendu", "-boost", "-cc"]),
    ] {
        let (map, unsupported) = map_of(options);
        assert_eq!(unsupported, names);
        assert_eq!(map, map_of("").0, "{options}");
    }
}
