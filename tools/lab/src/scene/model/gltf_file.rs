//! Reads glTF 2.0 and GLB files as [`Part`]s. The `gltf` crate trusts some of a file's statements about its own
//! buffers, so this module checks them first.

use phasefront::Size;
use std::path::Path;
use std::sync::Arc;

use gltf::accessor::{DataType, Dimensions};
use gltf::image::Source;
use gltf::material::AlphaMode;
use gltf::mesh::Mode;
use gltf::{Accessor, Gltf, Node, Primitive, Semantic, buffer};

use crate::scene::model::beside::Beside;
use crate::scene::model::part::{MAX_MODEL_BYTES, MAX_MODEL_TRIANGLES, Part, check_count};
use crate::scene::{Texture, texture};
use phasefront_core::runtime::file;

type Result<T> = std::result::Result<T, String>;

/// A matrix of columns, as in glTF.
type Matrix = [[f32; 4]; 4];

/// The exponent of the encoding for the eye. glTF's colour factors are linear; its pictures and our amplitudes are
/// encoded.
const GAMMA: f64 = 2.2;

/// Reads the parts of the file's default scene, or of its first scene if there is no default.
pub(super) fn read(path: &Path) -> Result<Vec<Part>> {
    let bytes = file::read(path, MAX_MODEL_BYTES).map_err(|e| e.to_string())?;
    check_length(&bytes)?;
    let unchecked = Gltf::from_slice_without_validation(&bytes).map_err(|e| one_line(&e))?;
    check_names(unchecked.as_json())?;
    let Gltf { document, blob } = Gltf::from_slice(&bytes).map_err(|e| one_line(&e))?;
    let mut beside = Beside::new(path)?;
    let buffers = read_buffers(&document, blob, &mut beside)?;
    let scene = document
        .default_scene()
        .or_else(|| document.scenes().next())
        .ok_or("no scene")?;
    let mut reader = Reader {
        beside,
        buffers,
        textures: Vec::new(),
        triangles: 0,
        parts: Vec::new(),
    };
    reader.nodes(scene.nodes(), document.nodes().len())?;
    Ok(reader.parts)
}

/// Reads the file's buffers, which are in the file or beside it.
fn read_buffers(document: &gltf::Document, mut blob: Option<Vec<u8>>, beside: &mut Beside) -> Result<Vec<Vec<u8>>> {
    let mut read = |buffer: gltf::Buffer| {
        let bytes = match buffer.source() {
            buffer::Source::Uri(uri) => resource(uri, beside)?,
            buffer::Source::Bin => blob.take().ok_or("the file has no such part")?,
        };
        match bytes.len() < buffer.length() {
            true => Err(format!("it has {} bytes, not {}", bytes.len(), buffer.length())),
            false => Ok(bytes),
        }
    };
    (document.buffers())
        .map(|buffer| {
            let index = buffer.index();
            read(buffer).map_err(|e| format!("its buffers: {index}: {e}"))
        })
        .collect()
}

struct Reader {
    beside: Beside,
    buffers: Vec<Vec<u8>>,
    /// The textures made so far, each with the image and the material properties that it was made for.
    textures: Vec<(TextureKey, Arc<Texture>)>,
    triangles: usize,
    parts: Vec<Part>,
}

/// An image, with the colour factor and the alpha cutoff of a material.
#[derive(PartialEq, Clone)]
struct TextureKey {
    image: Option<usize>,
    factor: [f32; 4],
    /// The alpha at which a surface begins, or `None` if all of it is visible.
    cut: Option<f32>,
}

impl Reader {
    /// Adds the nodes and their descendants; the file has `count` nodes. Each node has at most one parent, so none is
    /// added twice.
    fn nodes<'a>(&mut self, roots: impl Iterator<Item = Node<'a>>, count: usize) -> Result<()> {
        let identity = std::array::from_fn(|i| std::array::from_fn(|j| f32::from(u8::from(i == j))));
        let mut seen = vec![false; count];
        let mut waiting: Vec<(Node, Matrix)> = roots.map(|root| (root, identity)).collect();
        waiting.reverse();
        while let Some((node, parent)) = waiting.pop() {
            if std::mem::replace(&mut seen[node.index()], true) {
                return Err(format!(
                    "node {} has two parents or is its own; one is right",
                    node.index()
                ));
            }
            let matrix = product(parent, node.transform().matrix());
            if let Some(mesh) = node.mesh() {
                for primitive in mesh.primitives() {
                    self.primitive(&primitive, matrix)?;
                }
            }
            let first = waiting.len();
            waiting.extend(node.children().map(|child| (child, matrix)));
            waiting[first..].reverse();
        }
        Ok(())
    }

    fn primitive(&mut self, primitive: &Primitive, matrix: Matrix) -> Result<()> {
        let mode = primitive.mode();
        if !matches!(mode, Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan) {
            log::warn!("points and lines of a model are left out");
            return Ok(());
        }
        let positions = primitive
            .get(&Semantic::Positions)
            .ok_or("a surface without positions")?;
        let count = positions.count();
        check(&positions, &[DataType::F32], &[Dimensions::Vec3])?;
        let corners = primitive.indices().map_or(count, |indices| indices.count());
        self.triangles = self
            .triangles
            .saturating_add(if mode == Mode::Triangles { corners / 3 } else { corners });
        check_count(self.triangles.max(count / 3))?;

        let buffers = &self.buffers;
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|data| &data[..]));
        let missing = |what: &str| format!("{what} lie outside their buffer");
        let mut part = Part {
            positions: reader.read_positions().ok_or_else(|| missing("positions"))?.collect(),
            ..Part::default()
        };
        let indices = self.indices(primitive, part.positions.len())?;
        part.triangles = triangles(&indices, mode);
        if let Some(normals) = primitive.get(&Semantic::Normals) {
            check(&normals, &[DataType::F32], &[Dimensions::Vec3])?;
            part.normals = reader.read_normals().ok_or_else(|| missing("normals"))?.collect();
        }
        if let Some(colours) = primitive.get(&Semantic::Colors(0)) {
            check(
                &colours,
                &[DataType::F32, DataType::U8, DataType::U16],
                &[Dimensions::Vec3, Dimensions::Vec4],
            )?;
            let colours = reader.read_colors(0).ok_or_else(|| missing("colours"))?.into_rgb_f32();
            part.colour = colours.map(|rgb| rgb.map(coded)).collect();
        }
        self.material(primitive, &mut part)?;
        let same = |length: usize| length == 0 || length == part.positions.len();
        if ![part.normals.len(), part.uv.len(), part.colour.len()]
            .into_iter()
            .all(same)
        {
            return Err(
                "a surface whose vertices and their normals, colours or texture coordinates differ in number".into(),
            );
        }
        transform(&mut part, matrix);
        self.parts.push(part);
        Ok(())
    }

    /// Returns the vertex indices of the triangles' corners, each below `count`.
    fn indices(&self, primitive: &Primitive, count: usize) -> Result<Vec<u32>> {
        let Some(indices) = primitive.indices() else {
            return Ok((0..count as u32).collect());
        };
        check(
            &indices,
            &[DataType::U8, DataType::U16, DataType::U32],
            &[Dimensions::Scalar],
        )?;
        let buffers = &self.buffers;
        let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|data| &data[..]));
        let indices = reader.read_indices().ok_or("indices lie outside their buffer")?;
        let indices: Vec<u32> = indices.into_u32().collect();
        match indices.iter().find(|&&index| index as usize >= count) {
            Some(index) => Err(format!("a triangle names vertex {index}, but there are {count}")),
            None => Ok(indices),
        }
    }

    /// Sets the part's texture and texture coordinates.
    fn material(&mut self, primitive: &Primitive, part: &mut Part) -> Result<()> {
        let material = primitive.material();
        let base = material.pbr_metallic_roughness();
        part.two_sided = material.double_sided();
        let mut image = None;
        if let Some(info) = base.base_color_texture() {
            let set = info.tex_coord();
            if let Some(uv) = primitive.get(&Semantic::TexCoords(set)) {
                check(&uv, &[DataType::F32, DataType::U8, DataType::U16], &[Dimensions::Vec2])?;
                let buffers = &self.buffers;
                let reader = primitive.reader(|buffer| buffers.get(buffer.index()).map(|data| &data[..]));
                let uv = reader
                    .read_tex_coords(set)
                    .ok_or("texture coordinates lie outside their buffer")?;
                part.uv = uv.into_f32().collect();
                image = Some(info.texture().source());
            } else {
                log::warn!("a surface of a model has a texture but no texture coordinates: its plain colour is used");
            }
        }
        let cut = match material.alpha_mode() {
            AlphaMode::Opaque => None,
            AlphaMode::Mask => Some(material.alpha_cutoff().unwrap_or(0.5)),
            AlphaMode::Blend => Some(0.5),
        };
        let key = TextureKey {
            image: image.as_ref().map(gltf::Image::index),
            factor: base.base_color_factor(),
            cut,
        };
        if let Some((_, texture)) = self.textures.iter().find(|(known, _)| *known == key) {
            part.texture = Some(texture.clone());
            return Ok(());
        }
        let (width, height, texels) = match image {
            Some(image) => self.image(&image)?,
            None => (1, 1, vec![[255; 4]]),
        };
        let factor = [0, 1, 2].map(|c| coded(key.factor[c]));
        let texels = texels.into_iter().map(|[r, g, b, a]| {
            let [r, g, b] = [(r, 0), (g, 1), (b, 2)].map(|(v, c)| (f32::from(v) * factor[c]).round() as u8);
            // Maps the material's alpha cutoff to one half, where our surfaces begin.
            let alpha = f32::from(a) / 255.0 * key.factor[3];
            let alpha = key.cut.map_or(1.0, |cut| {
                if cut > 0.0 {
                    alpha * texture::ALPHA_CUT / cut
                } else {
                    1.0
                }
            });
            [r, g, b, (alpha * 255.0).round() as u8]
        });
        let texture = Arc::new(Texture::new(Size { width, height }, texels.collect()).map_err(|e| e.to_string())?);
        self.textures.push((key, texture.clone()));
        part.texture = Some(texture);
        Ok(())
    }

    /// Reads the width, height and RGBA texels of an image in the file or beside it.
    fn image(&mut self, image: &gltf::Image) -> Result<(usize, usize, Vec<[u8; 4]>)> {
        let texels = match image.source() {
            Source::Uri { uri, .. } => resource(uri, &mut self.beside).and_then(|bytes| self.beside.texels(&bytes)),
            Source::View { view, .. } => {
                let end = view.offset().checked_add(view.length());
                let held = self.buffers.get(view.buffer().index());
                let bytes = held.zip(end).and_then(|(data, end)| data.get(view.offset()..end));
                (bytes.ok_or_else(|| "it lies outside its buffer".into())).and_then(|bytes| self.beside.texels(bytes))
            }
        };
        texels.map_err(|e| format!("picture {}: {e}", image.index()))
    }
}

/// Reads the bytes that a URI names: those in the URI itself, or a file beside the model.
fn resource(uri: &str, beside: &mut Beside) -> Result<Vec<u8>> {
    match uri.strip_prefix("data:") {
        // The crate decodes data that is in the URI itself.
        Some(_) => buffer::Data::from_source(buffer::Source::Uri(uri), None)
            .map(|data| data.0)
            .map_err(|e| one_line(&e)),
        None => beside.read(&file_name(uri)?),
    }
}

/// Returns the corners of each triangle. In strips, every second triangle is reversed, so all fronts face one way.
fn triangles(indices: &[u32], mode: Mode) -> Vec<[u32; 3]> {
    match mode {
        Mode::TriangleStrip => {
            let turned = |(index, t): (usize, &[u32])| {
                if index % 2 == 0 {
                    [t[0], t[1], t[2]]
                } else {
                    [t[1], t[0], t[2]]
                }
            };
            indices.windows(3).enumerate().map(turned).collect()
        }
        Mode::TriangleFan => {
            let rim = indices.get(1..).unwrap_or_default();
            rim.windows(2).map(|pair| [indices[0], pair[0], pair[1]]).collect()
        }
        _ => indices.chunks_exact(3).map(|t| [t[0], t[1], t[2]]).collect(),
    }
}

/// Moves the part to the position of its node.
fn transform(part: &mut Part, m: Matrix) {
    for p in &mut part.positions {
        *p = std::array::from_fn(|i| m[0][i] * p[0] + m[1][i] * p[1] + m[2][i] * p[2] + m[3][i]);
    }
    // The cofactor matrix transforms normals: it is the transposed inverse up to a factor.
    let minor = |r: usize, c: usize| {
        let (r1, r2, c1, c2) = ((r + 1) % 3, (r + 2) % 3, (c + 1) % 3, (c + 2) % 3);
        m[c1][r1] * m[c2][r2] - m[c2][r1] * m[c1][r2]
    };
    for n in &mut part.normals {
        *n = std::array::from_fn(|i| (0..3).map(|j| minor(i, j) * n[j]).sum());
    }
    let determinant: f32 = (0..3).map(|j| m[j][0] * minor(0, j)).sum();
    if determinant < 0.0 {
        // A mirrored node keeps its front faces in front.
        part.triangles.iter_mut().for_each(|t| t.swap(1, 2));
        part.normals.iter_mut().for_each(|n| *n = n.map(|v| -v));
    }
}

fn product(a: Matrix, b: Matrix) -> Matrix {
    std::array::from_fn(|j| std::array::from_fn(|i| (0..4).map(|k| a[k][i] * b[j][k]).sum()))
}

/// Encodes a linear colour factor for the eye.
fn coded(factor: f32) -> f32 {
    libm::pow(f64::from(factor.clamp(0.0, 1.0)), 1.0 / GAMMA) as f32
}

/// Checks that the length that a GLB states covers its header, because the crate subtracts the header's length.
fn check_length(bytes: &[u8]) -> Result<()> {
    const HEADER: u32 = 12;
    match bytes {
        [b'g', b'l', b'T', b'F', _, _, _, _, a, b, c, d, ..] => match u32::from_le_bytes([*a, *b, *c, *d]) {
            length if length < HEADER => Err(format!(
                "it says that it has {length} bytes; {HEADER} are the fewest, its header"
            )),
            _ => Ok(()),
        },
        _ => Ok(()),
    }
}

/// Checks the assumptions of the crate's own validation and reading: attributes name existing accessors, and images
/// state their source and, for images in the file, their type.
fn check_names(root: &gltf::json::Root) -> Result<()> {
    let mut attributes = root
        .meshes
        .iter()
        .flat_map(|mesh| &mesh.primitives)
        .flat_map(|part| part.attributes.values());
    if let Some(index) = attributes.find(|index| index.value() >= root.accessors.len()) {
        return Err(format!(
            "a surface names accessor {}, but there are {}",
            index.value(),
            root.accessors.len()
        ));
    }
    let placed = |image: &gltf::json::Image| match image.buffer_view {
        Some(_) => image.mime_type.is_some(),
        None => image.uri.is_some(),
    };
    match root.images.iter().position(|image| !placed(image)) {
        Some(index) => Err(format!("picture {index} does not say where it is, or of which kind")),
        None => Ok(()),
    }
}

/// Checks that the accessor has one of these types and shapes and that its items do not overlap.
fn check(accessor: &Accessor, types: &[DataType], shapes: &[Dimensions]) -> Result<()> {
    let bad = |reason: &str| Err(format!("accessor {}: {reason}", accessor.index()));
    if !types.contains(&accessor.data_type()) || !shapes.contains(&accessor.dimensions()) {
        return bad("not of a type that glTF allows for its use");
    }
    if accessor.count() == 0 || accessor.count() > 3 * MAX_MODEL_TRIANGLES {
        return bad(&format!(
            "{} items; 1 to {} are read",
            accessor.count(),
            3 * MAX_MODEL_TRIANGLES
        ));
    }
    let overlaps = |view: Option<buffer::View>, size: usize| view.and_then(|v| v.stride()).is_some_and(|s| s < size);
    let sparse_overlaps = accessor.sparse().is_some_and(|sparse| {
        sparse.count() == 0
            || overlaps(Some(sparse.values().view()), accessor.size())
            || overlaps(Some(sparse.indices().view()), sparse.indices().index_type().size())
    });
    if overlaps(accessor.view(), accessor.size()) || sparse_overlaps {
        return bad("its items overlap");
    }
    Ok(())
}

/// Returns the file name in a URI, with its percent-encoding decoded.
fn file_name(uri: &str) -> Result<String> {
    let bytes = uri.as_bytes();
    let digit = |index: usize| bytes.get(index).and_then(|&b| char::from(b).to_digit(16));
    let mut decoded = Vec::with_capacity(bytes.len());
    let mut index = 0;
    while index < bytes.len() {
        if bytes[index] == b'%'
            && let (Some(high), Some(low)) = (digit(index + 1), digit(index + 2))
        {
            decoded.push((16 * high + low) as u8);
            index += 3;
        } else {
            decoded.push(bytes[index]);
            index += 1;
        }
    }
    String::from_utf8(decoded).map_err(|_| format!("{uri} is not the name of a file"))
}

/// Returns the crate's message on one line.
fn one_line(error: &gltf::Error) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}
