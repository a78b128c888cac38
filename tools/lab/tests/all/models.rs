//! Tests models from glTF, GLB and OBJ files: their rendered images, ignored features, and refused files.
use phasefront::Size;
use phasefront_io::ldi::Ldi;
use phasefront_lab::scene::shapes::Light;
use phasefront_lab::scene::{MAX_MODEL_TRIANGLES, read_model, render_ldi_reference};
use serde_json::{Value, json};
use std::fs;
use std::path::{Path, PathBuf};

const RED: [f32; 3] = [1.0, 0.0, 0.0];
const GREEN: [f32; 3] = [0.0, 1.0, 0.0];
const BLUE: [f32; 3] = [0.0, 0.0, 1.0];
const WHITE: [f32; 3] = [1.0; 3];

/// Reads a model and renders two layers of 40×20 pixels: a square fills columns 11 to 28 and rows 1 to 18.
fn seen(path: &Path) -> Ldi {
    let scene = read_model(path, Size { width: 40, height: 20 }, None).unwrap();
    render_ldi_reference(&scene, Size { width: 40, height: 20 }, 2).unwrap()
}

/// Returns the colours at the centres of the square's quarters: top left, top right, bottom left, bottom right.
fn quarters(ldi: &Ldi) -> [[f32; 3]; 4] {
    let layer = &ldi.layers[0];
    [(5, 15), (5, 24), (14, 15), (14, 24)].map(|(y, x)| {
        assert!(!layer.depth[[y, x]].is_nan(), "nothing at ({y}, {x})");
        [0, 1, 2].map(|c| layer.rgb[[c, y, x]])
    })
}

fn hits(ldi: &Ldi, layer: usize) -> usize {
    ldi.layers[layer].depth.iter().filter(|d| !d.is_nan()).count()
}

/// Encodes a PNG of red, green, blue and white pixels. The last pixel has the given alpha.
fn picture(alpha: u8) -> Vec<u8> {
    let mut image = image::RgbaImage::new(2, 2);
    for (index, colour) in [
        [255, 0, 0, 255],
        [0, 255, 0, 255],
        [0, 0, 255, 255],
        [255, 255, 255, alpha],
    ]
    .into_iter()
    .enumerate()
    {
        image.put_pixel(index as u32 % 2, index as u32 / 2, image::Rgba(colour));
    }
    let mut png = std::io::Cursor::new(Vec::new());
    image.write_to(&mut png, image::ImageFormat::Png).unwrap();
    png.into_inner()
}

/// Returns a square from −1 to 1 with that picture, as glTF's JSON and its buffer.
fn square() -> (Value, Vec<u8>) {
    let mut buffer = Vec::new();
    let positions = [[-1.0f32, -1., 0.], [1., -1., 0.], [1., 1., 0.], [-1., 1., 0.]];
    let uv = [[0.0f32, 1.], [1., 1.], [1., 0.], [0., 0.]];
    let colours = [[1.0f32, 0., 0.]; 4];
    positions.iter().flatten().for_each(|v| buffer.extend(v.to_le_bytes()));
    uv.iter().flatten().for_each(|v| buffer.extend(v.to_le_bytes()));
    colours.iter().flatten().for_each(|v| buffer.extend(v.to_le_bytes()));
    [0u16, 1, 2, 0, 2, 3]
        .iter()
        .for_each(|v| buffer.extend(v.to_le_bytes()));
    let png = picture(0);
    buffer.extend(&png);
    let json = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0, "TEXCOORD_0": 1}, "indices": 3, "material": 0}]}],
        "materials": [{"pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}],
        "textures": [{"source": 0}],
        "images": [{"bufferView": 4, "mimeType": "image/png"}],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [-1, -1, 0], "max": [1, 1, 0]},
            {"bufferView": 1, "componentType": 5126, "count": 4, "type": "VEC2"},
            {"bufferView": 2, "componentType": 5126, "count": 4, "type": "VEC3"},
            {"bufferView": 3, "componentType": 5123, "count": 6, "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": 48},
            {"buffer": 0, "byteOffset": 48, "byteLength": 32},
            {"buffer": 0, "byteOffset": 80, "byteLength": 48},
            {"buffer": 0, "byteOffset": 128, "byteLength": 12},
            {"buffer": 0, "byteOffset": 140, "byteLength": png.len()},
        ],
        "buffers": [{"byteLength": buffer.len()}],
    });
    (json, buffer)
}

fn glb(json: &Value, buffer: &[u8]) -> Vec<u8> {
    let mut text = json.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    let mut buffer = buffer.to_vec();
    buffer.resize(buffer.len().next_multiple_of(4), 0);
    let mut file = b"glTF".to_vec();
    let total = 12 + 8 + text.len() + 8 + buffer.len();
    [2, total as u32, text.len() as u32]
        .iter()
        .for_each(|v| file.extend(v.to_le_bytes()));
    file.extend(b"JSON");
    file.extend(&text);
    file.extend((buffer.len() as u32).to_le_bytes());
    file.extend(b"BIN\0");
    file.extend(&buffer);
    file
}

/// Writes the square to a file after `change`.
fn changed(folder: &Path, change: impl FnOnce(&mut Value)) -> PathBuf {
    let (mut json, buffer) = square();
    change(&mut json);
    let path = folder.join("model.glb");
    fs::write(&path, glb(&json, &buffer)).unwrap();
    path
}

fn refused(path: &Path, reason: &str) {
    let message = read_model(path, Size { width: 40, height: 20 }, None)
        .unwrap_err()
        .to_string();
    assert!(
        message.contains(path.file_name().unwrap().to_str().unwrap()),
        "{message}"
    );
    assert!(message.contains(reason), "expected '{reason}': {message}");
    assert!(!message.contains('\n'), "{message}");
}

#[test]
fn a_textured_glb_is_seen_upright_and_fits_the_frame() {
    let folder = tempfile::tempdir().unwrap();
    let ldi = seen(&changed(folder.path(), |_| {}));
    assert_eq!(
        quarters(&ldi),
        [RED, GREEN, BLUE, WHITE],
        "an opaque material has no holes"
    );
    for ((y, x), d) in ldi.layers[0].depth.indexed_iter() {
        assert_eq!(!d.is_nan(), (1..19).contains(&y) && (11..29).contains(&x), "({y}, {x})");
        assert!(d.is_nan() || *d == 0.5, "what is flat lies in the middle of the volume");
    }
    assert_eq!(hits(&ldi, 1), 0);
}

#[test]
fn gltf_with_files_beside_it_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let (mut json, buffer) = square();
    json["buffers"][0]["uri"] = json!("my%20data.bin");
    json["images"][0] = json!({"uri": "picture.png"});
    fs::write(folder.path().join("my data.bin"), buffer).unwrap();
    fs::write(folder.path().join("picture.png"), picture(255)).unwrap();
    let path = folder.path().join("model.gltf");
    fs::write(&path, json.to_string()).unwrap();
    assert_eq!(quarters(&seen(&path)), [RED, GREEN, BLUE, WHITE]);

    fs::write(folder.path().join("picture.png"), &picture(255)[..40]).unwrap();
    refused(&path, "picture 0");
    fs::remove_file(folder.path().join("picture.png")).unwrap();
    refused(&path, "picture 0");
    fs::remove_file(folder.path().join("my data.bin")).unwrap();
    refused(&path, "its buffers");
}

#[test]
fn nodes_turn_mirror_and_stack() {
    let folder = tempfile::tempdir().unwrap();
    // A quarter turn counter-clockwise about z, below a node that mirrors x.
    let half = 0.5f64.sqrt();
    let path = changed(folder.path(), |json| {
        json["nodes"] = json!([
            {"children": [1], "scale": [-3, 3, 3], "translation": [5, 6, 7]},
            {"mesh": 0, "rotation": [0, 0, half, half]},
        ]);
    });
    // Turned: green, white over red, blue. Mirrored: white, green over blue, red.
    assert_eq!(quarters(&seen(&path)), [WHITE, GREEN, BLUE, RED]);
}

#[test]
fn depth_fills_the_volume_near_to_far() {
    let folder = tempfile::tempdir().unwrap();
    // There are two squares. The second is smaller, behind the first, and at the right.
    let path = changed(folder.path(), |json| {
        json["scenes"][0]["nodes"] = json!([0, 1]);
        json["nodes"] = json!([{"mesh": 0}, {"mesh": 0, "translation": [0, 0, -40]}]);
    });
    let ldi = seen(&path);
    assert!(
        ldi.layers[0]
            .depth
            .iter()
            .all(|d| d.is_nan() || (d - 0.02).abs() < 1e-6)
    );
    assert!(
        ldi.layers[1]
            .depth
            .iter()
            .all(|d| d.is_nan() || (d - 0.98).abs() < 1e-6)
    );
    assert_eq!(hits(&ldi, 0), hits(&ldi, 1));
}

#[test]
fn backs_are_seen_of_two_sided_surfaces_only() {
    let folder = tempfile::tempdir().unwrap();
    let turned = |two_sided: bool| {
        changed(folder.path(), |json| {
            json["nodes"][0]["rotation"] = json!([0, 1, 0, 0]);
            json["materials"][0]["doubleSided"] = json!(two_sided);
        })
    };
    assert_eq!(quarters(&seen(&turned(true))), [GREEN, RED, WHITE, BLUE]);
    assert_eq!(hits(&seen(&turned(false)), 0), 0);
}

#[test]
fn alpha_cuts_holes_where_the_material_says_so() {
    let folder = tempfile::tempdir().unwrap();
    for mode in ["MASK", "BLEND"] {
        let ldi = seen(&changed(folder.path(), |json| {
            json["materials"][0]["alphaMode"] = json!(mode)
        }));
        assert!(ldi.layers[0].depth[[14, 24]].is_nan(), "{mode}");
        assert!(!ldi.layers[0].depth[[5, 15]].is_nan(), "{mode}");
    }
    let path = changed(folder.path(), |json| {
        json["materials"][0]["alphaMode"] = json!("MASK");
        json["materials"][0]["alphaCutoff"] = json!(0.0);
    });
    assert_eq!(quarters(&seen(&path))[3], WHITE);
}

#[test]
fn without_texture_coordinates_the_plain_and_vertex_colours_are_seen() {
    let folder = tempfile::tempdir().unwrap();
    let path = changed(folder.path(), |json| {
        json["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0});
        json["materials"][0]["pbrMetallicRoughness"]["baseColorFactor"] = json!([0, 1, 0, 1]);
    });
    assert_eq!(quarters(&seen(&path)), [GREEN; 4]);
    let path = changed(folder.path(), |json| {
        json["meshes"][0]["primitives"][0]["attributes"] = json!({"POSITION": 0, "COLOR_0": 2});
    });
    assert_eq!(quarters(&seen(&path)), [RED; 4]);
    // A linear factor of 0.5 is 0.73 in sRGB.
    let path = changed(folder.path(), |json| {
        json["materials"][0]["pbrMetallicRoughness"] = json!({"baseColorFactor": [0.5, 0.5, 0.5, 1]});
    });
    assert!((quarters(&seen(&path))[0][0] - 0.5f32.powf(1.0 / 2.2)).abs() < 0.003);
}

#[test]
fn strips_and_fans_are_triangles_too() {
    let folder = tempfile::tempdir().unwrap();
    for (mode, corners) in [(5, [0u16, 1, 3, 2]), (6, [0, 1, 2, 3])] {
        let (mut json, mut buffer) = square();
        json["meshes"][0]["primitives"][0]["mode"] = json!(mode);
        json["accessors"][3]["count"] = json!(4);
        corners
            .iter()
            .enumerate()
            .for_each(|(i, v)| buffer[128 + 2 * i..][..2].copy_from_slice(&v.to_le_bytes()));
        let path = folder.path().join("model.glb");
        fs::write(&path, glb(&json, &buffer)).unwrap();
        assert_eq!(quarters(&seen(&path)), [RED, GREEN, BLUE, WHITE], "mode {mode}");
    }
}

#[test]
fn light_shades_what_it_does_not_meet_in_the_face() {
    let folder = tempfile::tempdir().unwrap();
    let path = changed(folder.path(), |_| {});
    let brightness = |direction: [f64; 3]| {
        let scene = read_model(
            &path,
            Size { width: 40, height: 20 },
            Some(Light {
                direction,
                ambient: 0.2,
            }),
        )
        .unwrap();
        quarters(&render_ldi_reference(&scene, Size { width: 40, height: 20 }, 1).unwrap())[3][0]
    };
    assert_eq!(brightness([0.0, 0.0, 1.0]), 1.0);
    assert!((brightness([0.6, 0.0, 0.8]) - 0.84).abs() < 1e-6);
    assert!((brightness([1.0, 0.0, 0.0]) - 0.2).abs() < 1e-6);
}

#[test]
fn broken_gltf_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    refused(&folder.join("absent.glb"), "No such file");
    fs::write(folder.join("model.stl"), "solid").unwrap();
    refused(&folder.join("model.stl"), ".gltf, .glb and .obj");
    fs::write(folder.join("short.glb"), b"glTF\x02\0\0\0\x0b\0\0\0").unwrap();
    refused(&folder.join("short.glb"), "it has 11 bytes; 12 are the fewest");
    fs::write(folder.join("empty.glb"), "").unwrap();
    assert!(read_model(&folder.join("empty.glb"), Size { width: 40, height: 20 }, None).is_err());

    let refused = |change: &dyn Fn(&mut Value), reason: &str| refused(&changed(folder, change), reason);
    refused(&|json| json["scenes"][0]["nodes"] = json!([]), "no triangles");
    refused(
        &|json| json["accessors"][3]["count"] = json!(3 * MAX_MODEL_TRIANGLES as u64 + 3),
        "at most",
    );
    refused(&|json| json["accessors"][0]["count"] = json!(1u64 << 60), "items; 1 to");
    refused(
        &|json| json["accessors"][0]["count"] = json!(3),
        "vertex 3, but there are 3",
    );
    refused(&|json| json["accessors"][1]["count"] = json!(3), "differ in number");
    refused(
        &|json| json["accessors"][0]["count"] = json!(4000),
        "outside their buffer",
    );
    refused(&|json| json["accessors"][3]["type"] = json!("VEC3"), "accessor 3");
    refused(
        &|json| json["accessors"][1]["componentType"] = json!(5120),
        "accessor 1",
    );
    refused(&|json| json["bufferViews"][0]["byteStride"] = json!(4), "overlap");
    refused(
        &|json| json["bufferViews"][4]["byteLength"] = json!(99999),
        "outside its buffer",
    );
    refused(
        &|json| json["bufferViews"][4]["byteOffset"] = json!(u64::MAX),
        "outside its buffer",
    );
    refused(
        &|json| json["images"][0] = json!({"uri": "%ff.png"}),
        "not the name of a file",
    );
    refused(&|json| json["nodes"] = json!([{"mesh": 0, "children": [0]}]), "its own");
    let twice = json!([{"children": [1, 1]}, {"mesh": 0}]);
    refused(&|json| json["nodes"] = twice.clone(), "node 1 has two parents");
    refused(&|json| json["nodes"][0]["scale"] = json!([1e39, 1, 1]), "not finite");
    refused(&|json| json["nodes"][0]["scale"] = json!([0, 0, 1]), "has no size");
}

#[test]
fn nodes_may_lie_as_deep_as_they_like() {
    let folder = tempfile::tempdir().unwrap();
    let deep = changed(folder.path(), |json| {
        let nodes: Vec<_> = (1..5000).map(|child| json!({"children": [child]})).collect();
        json["nodes"] = json!([nodes, vec![json!({"mesh": 0})]].concat());
    });
    assert_eq!(quarters(&seen(&deep))[0], RED);
}

/// Files that a model names must be regular files in its own folder.
#[test]
fn a_model_reads_nothing_but_its_folder() {
    let all = tempfile::tempdir().unwrap();
    let folder = all.path().join("model");
    fs::create_dir_all(folder.join("pictures")).unwrap();
    fs::write(all.path().join("secret.png"), picture(255)).unwrap();
    fs::write(folder.join("pictures/own.png"), picture(255)).unwrap();
    let of = |uri: &str| changed(&folder, |json| json["images"][0] = json!({"uri": uri}));
    assert_eq!(quarters(&seen(&of("pictures/own.png")))[0], RED);
    for (uri, reason) in [
        ("../secret.png", "outside the model's folder"),
        ("/etc/passwd", "outside the model's folder"),
        ("/dev/zero", "outside the model's folder"),
        ("file:///etc/passwd", "no such file"),
        ("pictures", "no regular file"),
    ] {
        refused(&of(uri), reason);
        refused(&changed(&folder, |json| json["buffers"][0]["uri"] = json!(uri)), reason);
        fs::write(folder.join("model.mtl"), format!("newmtl painted\nmap_Kd {uri}\n")).unwrap();
        if uri != "file:///etc/passwd" {
            refused(&obj(&folder, OBJ), reason);
        }
        // An unreadable material library leaves surfaces white, as a missing one does.
        let text = OBJ.replace("model.mtl", uri);
        assert_eq!(quarters(&seen(&obj(&folder, &text))), [WHITE; 4]);
    }
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(all.path().join("secret.png"), folder.join("link.png")).unwrap();
        refused(&of("link.png"), "outside the model's folder");
        refused(Path::new("/dev/null"), "no regular file");
    }
}

#[test]
fn a_small_picture_of_many_pixels_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    // The picture has 2²⁶ pixels and one more row, all black.
    let mut png = Vec::new();
    let mut encoder = png::Encoder::new(&mut png, 1 << 14, (1 << 12) + 1);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::One);
    let mut writer = encoder.write_header().unwrap();
    writer.write_image_data(&vec![0; (1 << 11) * ((1 << 12) + 1)]).unwrap();
    writer.finish().unwrap();
    fs::write(folder.path().join("large.png"), png).unwrap();
    let path = changed(folder.path(), |json| json["images"][0] = json!({"uri": "large.png"}));
    refused(&path, "16384×4097 pixels; 67108864 in all are the most");
}

/// What a damaged byte may become.
const DAMAGED: [u8; 7] = [0, b'0', b'9', b'-', b'"', 0x7f, 0xff];

/// Neither a truncated file nor a file with a wrong byte causes a panic. Each error is one line. Of [`DAMAGED`], byte n
/// becomes those that `values` gives of n.
fn damaged_glb(values: impl Fn(usize) -> std::ops::Range<usize>) {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.glb");
    let (json, buffer) = square();
    let whole = glb(&json, &buffer);
    let attempt = |bytes: &[u8]| {
        fs::write(&path, bytes).unwrap();
        let result = read_model(&path, Size { width: 40, height: 20 }, None);
        if let Err(error) = &result {
            assert!(!error.to_string().contains('\n'), "{error}");
        }
        result.is_ok()
    };
    assert!(attempt(&whole));
    for length in 0..whole.len() - 4 {
        assert!(
            !attempt(&whole[..length]),
            "{length} bytes of {} were taken for a model",
            whole.len()
        );
    }
    for index in 0..whole.len() {
        for value in &DAMAGED[values(index)] {
            let mut bytes = whole.clone();
            bytes[index] = *value;
            attempt(&bytes);
        }
    }
}

#[test]
fn damaged_glb_never_panics() {
    damaged_glb(|index| index % 7..index % 7 + 1);
}

#[test]
#[ignore = "slow: 6 seconds of a core"]
fn glb_damaged_in_every_way_never_panics() {
    damaged_glb(|_| 0..7);
}

const OBJ: &str = "mtllib model.mtl\no square\nv -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n\
    vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl painted\nf 1/1 2/2 3/3 4/4\n";

fn obj(folder: &Path, text: &str) -> PathBuf {
    let path = folder.join("model.obj");
    fs::write(&path, text).unwrap();
    path
}

#[test]
fn obj_with_its_materials_is_seen_upright() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(
        folder.path().join("model.mtl"),
        "newmtl painted\nKd 0 0.6 1\nmap_Kd picture.png\n",
    )
    .unwrap();
    fs::write(folder.path().join("picture.png"), picture(255)).unwrap();
    let path = obj(folder.path(), OBJ);
    assert_eq!(quarters(&seen(&path)), [RED, GREEN, BLUE, WHITE]);

    let plain = [0.0, 0.6, 1.0];
    let without_uv = OBJ.replace("f 1/1 2/2 3/3 4/4", "f 1 2 3 4");
    assert_eq!(quarters(&seen(&obj(folder.path(), &without_uv))), [plain; 4]);
    fs::write(folder.path().join("picture.png"), &picture(255)[..30]).unwrap();
    refused(&obj(folder.path(), OBJ), "picture.png");
    fs::remove_file(folder.path().join("picture.png")).unwrap();
    assert_eq!(quarters(&seen(&obj(folder.path(), OBJ))), [plain; 4]);
    for (kd, colour) in [
        ("0.6", [0.6; 3]),
        ("0.2 0.4", WHITE),
        ("spectral light.rfl", WHITE),
        ("", WHITE),
    ] {
        fs::write(folder.path().join("model.mtl"), format!("newmtl painted\nKd {kd}\n")).unwrap();
        assert_eq!(quarters(&seen(&obj(folder.path(), OBJ))), [colour; 4], "{kd}");
    }
    fs::remove_file(folder.path().join("model.mtl")).unwrap();
    assert_eq!(quarters(&seen(&obj(folder.path(), OBJ))), [WHITE; 4]);
}

#[test]
fn broken_obj_is_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    refused(&obj(folder, ""), "no triangles");
    refused(&obj(folder, "v 0 0 0\nv 1 0 0\nv 0 1 0\n"), "no triangles");
    refused(&obj(folder, "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 9\n"), "");
    refused(&obj(folder, "v 0 0 0\nv 1 0 zero\nv 0 1 0\nf 1 2 3\n"), "");
    refused(&obj(folder, "v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"), "not finite");
    refused(&obj(folder, "v 0 0 0\nv 0 0 1\nv 0 0 2\nf 1 2 3\n"), "has no size");
    fs::write(folder.join("model.obj"), [0xff, 0xfe, 0, 1, 2]).unwrap();
    assert!(read_model(&folder.join("model.obj"), Size { width: 40, height: 20 }, None).is_err());
    let path = obj(folder, OBJ);
    for index in 0..OBJ.len() {
        for value in [b'0', b'-', b'/', b'\n', b'e', 0xff] {
            let mut bytes = OBJ.as_bytes().to_vec();
            bytes[index] = value;
            fs::write(&path, bytes).unwrap();
            if let Err(error) = read_model(&path, Size { width: 40, height: 20 }, None) {
                assert!(!error.to_string().contains('\n'), "{error}");
            }
        }
    }
}
