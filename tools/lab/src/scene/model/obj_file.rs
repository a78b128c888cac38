//! Reads Wavefront OBJ files, their MTL files and pictures, as [`Part`]s.

use phasefront::Size;
use std::cell::RefCell;
use std::io::BufReader;
use std::path::Path;
use std::sync::Arc;

use tobj::{LoadOptions, Material};

use phasefront_core::runtime::file;

use crate::scene::Texture;
use crate::scene::model::beside::Beside;
use crate::scene::model::part::{MAX_MODEL_BYTES, Part, check_count};

type Result<T> = std::result::Result<T, String>;

pub(super) fn read(path: &Path) -> Result<Vec<Part>> {
    let options = LoadOptions {
        triangulate: true,
        single_index: true,
        ignore_points: true,
        ignore_lines: true,
    };
    let mut obj = BufReader::new(file::open(path, MAX_MODEL_BYTES).map_err(|e| e.to_string())?);
    let beside = RefCell::new(Beside::new(path)?);
    let library = |name: &Path| {
        let name = name.to_string_lossy().replace('\\', "/");
        match beside.borrow_mut().read(name.trim()) {
            Ok(text) => tobj::load_mtl_buf(&mut materials_of(&String::from_utf8_lossy(&text)).as_bytes()),
            Err(e) => {
                log::warn!(
                    "{}: its materials are not read ({e}); its surfaces are white",
                    path.display()
                );
                Ok(Default::default())
            }
        }
    };
    let (models, materials) = tobj::load_obj_buf(&mut obj, &options, library).map_err(|e| e.to_string())?;
    let materials = materials.unwrap_or_else(|e| {
        log::warn!(
            "{}: its materials are not read ({e}); its surfaces are white",
            path.display()
        );
        Vec::new()
    });
    check_count(models.iter().map(|model| model.mesh.indices.len() / 3).sum())?;
    let mut beside = beside.into_inner();
    let textures = materials
        .iter()
        .map(|material| texture(&mut beside, material))
        .collect::<Result<Vec<_>>>()?;
    models
        .into_iter()
        .map(|model| part(model, &materials, &textures))
        .collect()
}

/// Keeps the useful lines of a material library: names, diffuse colours of three numbers, and their pictures. The crate
/// that reads the library panics at a colour of one number, which denotes grey.
fn materials_of(library: &str) -> String {
    let mut lines = String::new();
    for line in library.lines() {
        let words: Vec<_> = line.split_whitespace().collect();
        match words[..] {
            ["newmtl" | "map_Kd", _, ..] => lines += line,
            ["Kd", grey] => lines += &format!("Kd {grey} {grey} {grey}"),
            ["Kd", r, g, b, ..] => lines += &format!("Kd {r} {g} {b}"),
            _ => continue,
        }
        lines.push('\n');
    }
    lines
}

/// Makes a part of a model. `textures` are those of `materials`.
fn part(model: tobj::Model, materials: &[Material], textures: &[Option<Arc<Texture>>]) -> Result<Part> {
    let mesh = model.mesh;
    let mut part = Part {
        positions: triples(&mesh.positions),
        triangles: triples(&mesh.indices),
        normals: triples(&mesh.normals),
        colour: triples(&mesh.vertex_color),
        // OBJ counts from the bottom of the picture.
        uv: mesh.texcoords.chunks_exact(2).map(|t| [t[0], 1.0 - t[1]]).collect(),
        ..Part::default()
    };
    let count = part.positions.len();
    if [part.normals.len(), part.colour.len()]
        .iter()
        .any(|&length| length != 0 && length != count)
    {
        return Err(format!(
            "object {}: its vertices and their normals or colours differ in number",
            model.name
        ));
    }
    if let Some(index) = mesh.indices.iter().find(|&&index| index as usize >= count) {
        return Err(format!(
            "object {}: a face names vertex {index}, but there are {count}",
            model.name
        ));
    }
    let number = mesh.material_id;
    if let Some((material, texture)) = number.and_then(|id| Some((materials.get(id)?, textures.get(id)?))) {
        clothe(&mut part, material, texture, &model.name);
    }
    if part.uv.len() != count {
        part.uv.clear();
    }
    Ok(part)
}

/// Sets the picture or the plain colour of a part of the object `name`.
fn clothe(part: &mut Part, material: &Material, texture: &Option<Arc<Texture>>, name: &str) {
    let pictured = texture.is_some() && part.uv.len() == part.positions.len();
    if texture.is_some() && !pictured {
        log::warn!("object {name} has a texture but no texture coordinates: its plain colour is used");
    }
    part.texture = texture.clone().filter(|_| pictured);
    let diffuse = material.diffuse.unwrap_or([1.0; 3]).map(|v| v.clamp(0.0, 1.0));
    // A picture replaces the diffuse colour, because many files set that to black when they name a picture.
    if !pictured {
        part.texture = Some(Arc::new(Texture::plain(diffuse)));
    }
}

/// Reads the picture of a material's diffuse colour. Returns `None` if the material names none or the file does not
/// exist.
fn texture(beside: &mut Beside, material: &Material) -> Result<Option<Arc<Texture>>> {
    let Some(name) = &material.diffuse_texture else {
        return Ok(None);
    };
    // Some programs write backslashes as separators.
    let name = name.trim().replace('\\', "/");
    let Some(bytes) = beside.read_if_there(&name)? else {
        log::warn!(
            "{name}: no such picture; the plain colour of material {} is used",
            material.name
        );
        return Ok(None);
    };
    let (width, height, texels) = (beside.texels(&bytes)).map_err(|e| format!("picture {name}: {e}"))?;
    let texture = Texture::new(Size { width, height }, texels).map_err(|e| e.to_string())?;
    Ok(Some(Arc::new(texture)))
}

fn triples<T: Copy>(flat: &[T]) -> Vec<[T; 3]> {
    flat.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect()
}
