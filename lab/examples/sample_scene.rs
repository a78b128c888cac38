//! Makes `samples/`: a toy room of 1920 x 1080 pixels whose depths run from a test chart near the viewer, over toys
//! and a ruler, to a brick wall at the back. `cargo run --release --example sample_scene [FOLDER]`
//!
//! Light falls through the same renderer: a directional light sees the scene sheared, and what it does not see is in
//! its shadow. The sum over a lamp and a sky of such lights shades the picture.

use std::f64::consts::{PI, TAU};
use std::path::Path;
use std::sync::Arc;

use image::codecs::jpeg::JpegEncoder;
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{ExtendedColorType, ImageEncoder, Rgb, RgbImage};
use ndarray::{Array2, Array3};
use phasefront_lab::scene::dice::Dice;
use phasefront_lab::scene::pattern::Pattern;
use phasefront_lab::scene::shapes::{Place, Shape, star, turn};
use phasefront_lab::scene::{Mesh, Scene, Texture, render_ldi_reference};
use rayon::prelude::*;

const WIDTH: usize = 1920;
const HEIGHT: usize = 1080;
/// Samples a pixel along each axis.
const FINE: usize = 2;
/// The volume's depth in pixels: 6 mm of 8 µm.
const VOLUME_PX: f64 = 750.0;
/// Where the floor meets the wall.
const SKIRTING_Y: f64 = 655.0;
const WALL_DEPTH: f64 = 0.95;

type Colour = [f32; 3];

const INK: Colour = [0.10, 0.11, 0.14];
const PAPER: Colour = [0.96, 0.94, 0.88];
const RED: Colour = [0.84, 0.25, 0.20];
const ORANGE: Colour = [0.95, 0.55, 0.16];
const YELLOW: Colour = [0.98, 0.80, 0.22];
const GREEN: Colour = [0.30, 0.62, 0.36];
const TEAL: Colour = [0.16, 0.55, 0.58];
const BLUE: Colour = [0.20, 0.40, 0.72];

/// A mesh and how much it shines.
struct Item {
    mesh: Mesh,
    gloss: f32,
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).unwrap_or_else(|| "samples".into());
    let folder = Path::new(&folder);
    std::fs::create_dir_all(folder)?;

    let room = room();
    let scene = Scene {
        meshes: room.iter().map(|item| item.mesh.clone()).collect(),
    };
    let depth = render_ldi_reference(&scene, HEIGHT, WIDTH, 1)?.layers.remove(0).depth;
    if depth.iter().any(|d| d.is_nan()) {
        return Err("the room has a hole".into());
    }
    let picture = shaded(&room)?;

    let mut jpeg = Vec::new();
    JpegEncoder::new_with_quality(&mut jpeg, 92).encode_image(&picture)?;
    std::fs::write(folder.join("scene_rgb.jpg"), &jpeg)?;

    let codes = depth.iter().map(|d| (d * 65535.0).round() as u16);
    let bytes: Vec<u8> = codes.flat_map(u16::to_ne_bytes).collect();
    let mut png = Vec::new();
    PngEncoder::new_with_quality(&mut png, CompressionType::Best, FilterType::Adaptive).write_image(
        &bytes,
        WIDTH as u32,
        HEIGHT as u32,
        ExtendedColorType::L16,
    )?;
    std::fs::write(folder.join("scene_depth.png"), &png)?;
    println!(
        "scene_rgb.jpg {} bytes, scene_depth.png {} bytes",
        jpeg.len(),
        png.len()
    );
    Ok(())
}

// ---- The room ----

/// Depth of the floor where it is seen at height `y`.
fn floor_depth(y: f64) -> f64 {
    WALL_DEPTH - (WALL_DEPTH - 0.05) * (y - SKIRTING_Y) / (HEIGHT as f64 - SKIRTING_Y)
}

fn room() -> Vec<Item> {
    let mut dice = Dice::new(2);
    let mut room = Vec::new();
    wall_and_floor(&mut room, &mut dice);
    painting(&mut room, &mut dice);
    clock(&mut room);
    bunting(&mut room);
    plant(&mut room, &mut dice);
    rings(&mut room);
    blocks(&mut room, &mut dice);
    ruler(&mut room, &mut dice);
    ball(&mut room);
    duck(&mut room);
    chart(&mut room, &mut dice);
    room
}

/// A surface: its picture, and how much it shines.
struct Skin(Texture, f32);

/// Puts a shape about (x, y) at depth d: half sizes `scale` in pixels, turned, its thickness pressed to `deep`.
fn put(
    room: &mut Vec<Item>,
    shape: &Shape,
    at: [f64; 3],
    scale: [f64; 3],
    rotation: [[f64; 3]; 3],
    deep: f64,
    skin: Skin,
) {
    let place = Place {
        scale_px: scale,
        rotation,
        depth_per_px: deep / VOLUME_PX,
        centre: [at[0], at[1], 0.5 - at[2]],
        light: None,
    };
    let Skin(texture, gloss) = skin;
    room.push(Item {
        mesh: shape.place(&place, Arc::new(texture)),
        gloss,
    });
}

fn upright() -> [[f64; 3]; 3] {
    turn([0.0, 0.0, 1.0], 0.0)
}

fn wall_and_floor(room: &mut Vec<Item>, dice: &mut Dice) {
    let size = (1440, 1024);
    let bricks = Pattern::bricks(size, 12, 16, 0.09, dice);
    let grain = Pattern::noise(size, (90, 64), 4, 0.8, dice);
    let stains = Pattern::noise(size, (5, 4), 4, 0.55, dice);
    let wall = bricks.mixed(&grain, 0.34).mixed(&stains, 0.22);
    let texture = wall.texture([[0.80, 0.76, 0.70], [0.62, 0.36, 0.27], [0.72, 0.45, 0.33]]);
    let (w, h) = (WIDTH as f64, SKIRTING_Y);
    put(
        room,
        &Shape::sheet(),
        [w / 2.0, h / 2.0 - 10.0, WALL_DEPTH],
        [w / 2.0 + 4.0, h / 2.0 + 14.0, 1.0],
        upright(),
        1.0,
        Skin(texture, 0.0),
    );

    let size = (2048, 1024);
    let grain = Pattern::noise(size, (220, 5), 4, 0.7, dice);
    let wood = Pattern::noise(size, (24, 2), 5, 0.6, dice);
    let tones: Vec<f32> = (0..64).map(|_| dice.range(0.0, 1.0) as f32).collect();
    let planks = Pattern::from_fn(size, |x, y| {
        let board = x * 14 / size.0;
        let along = y + 300 * (board * 5 % 7);
        let gap = x * 14 % size.0 < 60 || along % 760 < 5;
        let tone = tones[(board * 3 + along / 760) % 64];
        if gap {
            0.0
        } else {
            0.45 + 0.25 * tone + 0.3 * (0.6 * grain.at(x, y) + 0.4 * wood.at(x, y))
        }
    });
    let texture = planks.texture([[0.16, 0.10, 0.07], [0.56, 0.40, 0.26], [0.86, 0.70, 0.50]]);
    let bottom = HEIGHT as f64 + 8.0;
    let floor = Shape::grid(1, 1, |u, v| {
        let y = bottom + (SKIRTING_Y - 8.0 - bottom) * v;
        [1930.0 * (u - 0.5), -y, VOLUME_PX * (0.5 - floor_depth(y))]
    });
    put(
        room,
        &floor,
        [w / 2.0, 0.0, 0.5],
        [1.0; 3],
        upright(),
        1.0,
        Skin(texture, 0.12),
    );

    let board = Texture::plain([0.90, 0.88, 0.83]);
    put(
        room,
        &Shape::cuboid(),
        [w / 2.0, SKIRTING_Y - 14.0, 0.935],
        [w / 2.0 + 4.0, 20.0, 8.0],
        upright(),
        1.0,
        Skin(board, 0.1),
    );
}

/// A frame of four bars about a picture of hills at dusk.
fn painting(room: &mut Vec<Item>, dice: &mut Dice) {
    let (x, y, d) = (985.0, 285.0, 0.925);
    let (half_w, half_h) = (215.0, 150.0);
    let size = (860, 600);
    let sky = Pattern::noise(size, (3, 9), 5, 0.55, dice);
    let ridges = [0.52, 0.63, 0.75, 0.88].map(|base: f32| (base, Pattern::noise((size.0, 1), (5, 1), 6, 0.45, dice)));
    let mut canvas = Canvas::new(size, [0.0; 3]);
    let brush = Pattern::noise(size, (120, 60), 2, 0.7, dice);
    canvas.paint(|px, py| {
        let (u, v) = (px as f32 / size.0 as f32, py as f32 / size.1 as f32);
        let mut colour = mix([0.20, 0.30, 0.55], [0.99, 0.72, 0.42], (v / 0.6).min(1.0));
        colour = mix(colour, [0.98, 0.82, 0.66], 0.7 * (sky.at(px, py) - 0.5).max(0.0));
        let sun = ((u - 0.66) * 1.43).hypot(v - 0.36);
        colour = mix(colour, [1.0, 0.95, 0.78], ((0.085 - sun) * 200.0).clamp(0.0, 1.0));
        colour = mix(colour, [1.0, 0.85, 0.55], (0.5 - 2.0 * sun).clamp(0.0, 0.5));
        for (index, (base, ridge)) in ridges.iter().enumerate() {
            if v > base + 0.26 * (0.5 - ridge.at(px, 0)) {
                let shade = index as f32 / 3.0;
                colour = mix([0.62, 0.50, 0.62], [0.08, 0.20, 0.22], shade);
                colour = mix(colour, [0.55, 0.62, 0.35], 0.35 * shade * brush.at(px, py));
            }
        }
        Some(mix(colour, [0.5; 3], 0.12 * (brush.at(px, py) - 0.5)))
    });
    put(
        room,
        &Shape::sheet(),
        [x, y, d],
        [half_w, half_h, 1.0],
        upright(),
        1.0,
        Skin(canvas.texture(), 0.05),
    );
    let wood = Pattern::noise((256, 64), (4, 16), 4, 0.6, dice).texture([
        [0.28, 0.16, 0.08],
        [0.45, 0.27, 0.13],
        [0.62, 0.42, 0.22],
    ]);
    for (dx, dy, w, h) in [
        (0.0, -1.0, 1.0, 0.0),
        (0.0, 1.0, 1.0, 0.0),
        (-1.0, 0.0, 0.0, 1.0),
        (1.0, 0.0, 0.0, 1.0),
    ] {
        let at = [x + dx * (half_w + 6.0), y + dy * (half_h + 6.0), d - 0.008];
        let scale = [
            w * (half_w + 20.0) + 14.0 * (1.0 - w),
            h * (half_h + 20.0) + 14.0 * (1.0 - h),
            10.0,
        ];
        put(
            room,
            &Shape::cuboid(),
            at,
            scale,
            upright(),
            1.0,
            Skin(wood.clone(), 0.3),
        );
    }
}

fn clock(room: &mut Vec<Item>) {
    let (x, y) = (1580.0, 300.0);
    let side = 512;
    let mut canvas = Canvas::new((side, side), PAPER);
    let middle = side as f32 / 2.0;
    let toward = |turns: f32, r: f32| {
        let (sin, cos) = (turns * TAU as f32).sin_cos();
        [middle + r * middle * sin, middle - r * middle * cos]
    };
    for minute in 0..60 {
        let (from, pen) = if minute % 5 == 0 { (0.80, 4.0) } else { (0.88, 1.5) };
        canvas.stroke(
            toward(minute as f32 / 60.0, from),
            toward(minute as f32 / 60.0, 0.94),
            pen,
            INK,
        );
    }
    for hour in 1..=12u8 {
        let [cx, cy] = toward(f32::from(hour) / 12.0, 0.66);
        let label = hour.to_string();
        let width = label.len() as f32 * 26.0 - 8.0;
        canvas.write(&label, [cx - width / 2.0, cy - 15.0], 30.0, 2.6, INK);
    }
    canvas.stroke(toward(0.845, -0.1), toward(0.845, 0.46), 7.0, INK);
    canvas.stroke(toward(0.14, -0.1), toward(0.14, 0.74), 5.0, INK);
    canvas.stroke(toward(0.47, -0.16), toward(0.47, 0.80), 2.2, RED);
    canvas.stroke([middle, middle], [middle, middle], 11.0, RED);
    put(
        room,
        &Shape::polygon(&star(64, 1.0)),
        [x, y, 0.925],
        [108.0, 108.0, 1.0],
        upright(),
        1.0,
        Skin(canvas.texture(), 0.1),
    );
    put(
        room,
        &Shape::torus(128, 0.08),
        [x, y, 0.92],
        [118.0; 3],
        upright(),
        1.0,
        Skin(Texture::plain(TEAL), 0.7),
    );
}

/// Flags on a sagging string.
fn bunting(room: &mut Vec<Item>) {
    let sag = |t: f64| 44.0 + 92.0 * 4.0 * t * (1.0 - t);
    let (from, to, d) = (-40.0, 1960.0, 0.88);
    let flags = 17;
    let string = Shape::grid(160, 1, |u, v| {
        [from + (to - from) * u, -(sag(u) + 2.5 * (1.0 - 2.0 * v)), 0.0]
    });
    put(
        room,
        &string,
        [0.0, 0.0, d],
        [1.0; 3],
        upright(),
        1.0,
        Skin(Texture::plain([0.92, 0.88, 0.80]), 0.0),
    );
    for flag in 0..flags {
        let t = (flag as f64 + 0.5) / flags as f64;
        let slope = ((sag(t + 0.01) - sag(t - 0.01)) / (0.02 * (to - from))).atan();
        let colour = [RED, YELLOW, TEAL, PAPER, ORANGE, BLUE][flag % 6];
        let mut canvas = Canvas::new((96, 112), colour);
        let pale = mix(colour, if flag % 6 == 3 { RED } else { PAPER }, 0.85);
        match flag % 3 {
            0 => (0..20).for_each(|i| {
                let (cx, cy) = (
                    (i % 5) as f32 * 22.0 + 4.0 + if i / 5 % 2 == 0 { 0.0 } else { 11.0 },
                    (i / 5) as f32 * 24.0 + 12.0,
                );
                canvas.stroke([cx, cy], [cx, cy], 5.0, pale);
            }),
            1 => (0..5)
                .for_each(|i| canvas.stroke([0.0, i as f32 * 24.0 + 8.0], [96.0, i as f32 * 24.0 + 8.0], 4.0, pale)),
            _ => {}
        }
        // A flag bellies toward the viewer.
        let cloth = Shape::grid(12, 12, |u, v| {
            let half = 40.0 * v;
            [
                half * (2.0 * u - 1.0),
                96.0 * (v - 1.0),
                14.0 * (PI * v).sin() * (PI * u).sin(),
            ]
        });
        let at = [from + (to - from) * t, sag(t), d - 0.003];
        put(
            room,
            &cloth,
            at,
            [1.0; 3],
            turn([0.0, 0.0, 1.0], -slope),
            1.0,
            Skin(canvas.texture(), 0.0),
        );
    }
}

/// A pot of long leaves: thin edges in the middle of the volume.
fn plant(room: &mut Vec<Item>, dice: &mut Dice) {
    let (x, base) = (775.0, 775.0);
    let d = floor_depth(base) - 0.03;
    let clay = Pattern::noise((256, 128), (6, 20), 4, 0.6, dice).texture([
        [0.62, 0.30, 0.20],
        [0.76, 0.42, 0.29],
        [0.86, 0.54, 0.40],
    ]);
    let profile = |v: f64| {
        if v < 0.78 { 52.0 + 22.0 * v / 0.78 } else { 82.0 }
    };
    let pot = Shape::grid(64, 60, |u, v| {
        let (sin, cos) = (TAU * (u + 0.5)).sin_cos();
        [profile(v) * sin, 118.0 * v, profile(v) * cos]
    });
    put(
        room,
        &pot,
        [x, base, d],
        [1.0; 3],
        turn([1.0, 0.0, 0.0], 0.35),
        0.6,
        Skin(clay, 0.1),
    );
    put(
        room,
        &Shape::ball(48, |_| 1.0),
        [x, base - 108.0, d],
        [74.0, 26.0, 60.0],
        upright(),
        0.6,
        Skin(Texture::plain([0.16, 0.11, 0.08]), 0.0),
    );
    for leaf in 0..26 {
        let side = dice.range(-1.0, 1.0);
        let forward = dice.range(-1.0, 1.0);
        let long = dice.range(190.0, 320.0) * (1.0 - 0.25 * side * side);
        let wide = dice.range(11.0, 19.0);
        let vein = Canvas::leaf(dice, leaf);
        let blade = Shape::grid(6, 40, |u, v| {
            let half = wide * (PI * v.powf(0.75)).sin().max(0.0).powf(0.8);
            let across = 2.0 * u - 1.0;
            let lean = 190.0 * side * v * v + 20.0 * side * v;
            [
                lean + half * across,
                long * v * (1.0 - 0.32 * v * side.abs()),
                90.0 * forward * v * v + 0.35 * half * across.abs(),
            ]
        });
        put(
            room,
            &blade,
            [x + 24.0 * side, base - 110.0, d - 0.02 * forward],
            [1.0; 3],
            upright(),
            0.8,
            Skin(vein, 0.25),
        );
    }
}

/// A toy: rings on a pole.
fn rings(room: &mut Vec<Item>) {
    let (x, base) = (1365.0, 800.0);
    let d = floor_depth(base) - 0.04;
    let lean = turn([1.0, 0.0, 0.0], 0.45 - PI / 2.0);
    let colours = [RED, ORANGE, YELLOW, GREEN, BLUE];
    let mut y = base - 22.0;
    for (index, colour) in colours.into_iter().enumerate() {
        let radius = 108.0 - 15.0 * index as f64;
        let thick = 48.0;
        put(
            room,
            &Shape::torus(96, thick / 2.0 / radius),
            [x, y, d],
            [radius; 3],
            lean,
            0.7,
            Skin(Texture::plain(colour), 0.9),
        );
        y -= thick * 0.86;
    }
    put(
        room,
        &Shape::ball(64, |_| 1.0),
        [x, y - 4.0, d],
        [34.0; 3],
        upright(),
        0.7,
        Skin(Texture::plain(PAPER), 0.9),
    );
}

/// Alphabet blocks: R and G, and B on top.
fn blocks(room: &mut Vec<Item>, dice: &mut Dice) {
    let half = 66.0;
    for (letter, colour, x, y, angle) in [
        ("R", RED, 985.0, 793.0, 0.42),
        ("G", GREEN, 1150.0, 807.0, -0.30),
        ("B", BLUE, 1062.0, 667.0, 0.12),
    ] {
        let side = 384;
        let grain = Pattern::noise((side, side), (4, 40), 4, 0.6, dice);
        let mut canvas = Canvas::new((side, side), [0.0; 3]);
        canvas.paint(|px, py| Some(mix([0.86, 0.70, 0.48], [0.96, 0.84, 0.64], grain.at(px, py))));
        let (low, high) = (26.0, side as f32 - 26.0);
        for (from, to) in [
            ([low, low], [high, low]),
            ([high, low], [high, high]),
            ([high, high], [low, high]),
            ([low, high], [low, low]),
        ] {
            canvas.stroke(from, to, 11.0, colour);
        }
        canvas.write(letter, [128.0, 96.0], 192.0, 20.0, colour);
        let rotation = multiply(turn([1.0, 0.0, 0.0], 0.50), turn([0.0, 1.0, 0.0], angle));
        let d = floor_depth(880.0) - 0.08 + if letter == "B" { -0.01 } else { 0.0 };
        put(
            room,
            &Shape::cuboid(),
            [x, y, d],
            [half; 3],
            rotation,
            0.8,
            Skin(canvas.texture(), 0.15),
        );
    }
}

/// A ruler that lies on the floor from near to far: all depths are on it.
fn ruler(room: &mut Vec<Item>, dice: &mut Dice) {
    let size = (120, 2400);
    let grain = Pattern::noise(size, (30, 6), 4, 0.6, dice);
    let mut canvas = Canvas::new(size, [0.0; 3]);
    canvas.paint(|px, py| Some(mix([0.93, 0.76, 0.40], [0.99, 0.88, 0.58], grain.at(px, py))));
    for tick in 0..=120 {
        let y = 2380.0 - tick as f32 * 19.5;
        let length = if tick % 10 == 0 {
            64.0
        } else if tick % 5 == 0 {
            46.0
        } else {
            30.0
        };
        canvas.stroke(
            [120.0, y],
            [120.0 - length, y],
            if tick % 10 == 0 { 3.2 } else { 2.0 },
            INK,
        );
        if tick % 10 == 0 && tick > 0 && tick < 120 {
            canvas.write(&(tick / 10).to_string(), [10.0, y - 22.0], 44.0, 3.6, INK);
        }
    }
    let (near, far) = ([735.0, 1074.0], [893.0, 690.0]);
    let half = 36.0;
    let flat = Shape::grid(1, 1, |u, v| {
        let [x, y] = [0, 1].map(|i| near[i] + (far[i] - near[i]) * v);
        [
            x + half * (2.0 * u - 1.0),
            -y,
            VOLUME_PX * (0.5 - floor_depth(y) + 0.012),
        ]
    });
    put(
        room,
        &flat,
        [0.0, 0.0, 0.5],
        [1.0; 3],
        upright(),
        1.0,
        Skin(canvas.texture(), 0.2),
    );
}

fn ball(room: &mut Vec<Item>) {
    let (x, base, r) = (1240.0, 985.0, 78.0);
    let mut canvas = Canvas::new((512, 256), PAPER);
    canvas.paint(|px, py| match ((px * 6 / 512) % 2, py) {
        (_, 112..144) => Some(YELLOW),
        (0, _) => Some(RED),
        _ => None,
    });
    let rotation = multiply(turn([0.0, 0.0, 1.0], 0.5), turn([1.0, 0.0, 0.0], 0.6));
    let d = floor_depth(base) - 0.04;
    put(
        room,
        &Shape::ball(128, |_| 1.0),
        [x, base - r, d],
        [r; 3],
        rotation,
        0.7,
        Skin(canvas.texture(), 0.9),
    );
}

fn duck(room: &mut Vec<Item>) {
    let (x, base) = (1600.0, 1046.0);
    let d = floor_depth(base) + 0.06;
    let deep = 0.5;
    let mut part = |at: [f64; 3], scale: [f64; 3], angle: f64, colour: Colour, gloss: f32| {
        let at = [x + at[0], base - at[1], d - at[2] * deep / VOLUME_PX];
        let rotation = multiply(turn([0.0, 0.0, 1.0], angle), turn([0.0, 1.0, 0.0], PI));
        put(
            room,
            &Shape::ball(128, |_| 1.0),
            at,
            scale,
            rotation,
            deep,
            Skin(Texture::plain(colour), gloss),
        );
    };
    part([0.0, 118.0, 0.0], [205.0, 122.0, 140.0], 0.06, YELLOW, 0.8);
    part([172.0, 168.0, 0.0], [74.0, 46.0, 50.0], 0.75, YELLOW, 0.8);
    part([20.0, 130.0, 96.0], [112.0, 66.0, 58.0], 0.22, [0.96, 0.72, 0.14], 0.8);
    part([-96.0, 282.0, 10.0], [112.0, 106.0, 104.0], 0.0, YELLOW, 0.8);
    part([-206.0, 262.0, 24.0], [62.0, 20.0, 52.0], 0.10, ORANGE, 0.8);
    part([-200.0, 246.0, 24.0], [50.0, 16.0, 44.0], 0.28, [0.88, 0.42, 0.10], 0.8);
    part([-132.0, 312.0, 92.0], [24.0, 28.0, 16.0], 0.0, PAPER, 0.8);
    part([-138.0, 312.0, 104.0], [14.0, 17.0, 12.0], 0.0, INK, 1.0);
}

/// A test chart on an easel.
fn chart(room: &mut Vec<Item>, dice: &mut Dice) {
    let (x, y, d) = (362.0, 660.0, 0.10);
    let (half_w, half_h) = (262.0, 215.0);
    let canvas = chart_picture();
    let board = Canvas::wood(dice, [0.42, 0.27, 0.15]);
    put(
        room,
        &Shape::sheet(),
        [x, y, d],
        [half_w, half_h, 1.0],
        upright(),
        1.0,
        Skin(canvas.texture(), 0.05),
    );
    put(
        room,
        &Shape::cuboid(),
        [x, y, d + 0.008],
        [half_w + 12.0, half_h + 12.0, 4.0],
        upright(),
        1.0,
        Skin(board.clone(), 0.2),
    );
    for (dx, angle, back) in [(-190.0, -0.10, 0.0), (190.0, 0.10, 0.0)] {
        let leg = turn([0.0, 0.0, 1.0], angle);
        put(
            room,
            &Shape::cuboid(),
            [x + dx, y + 160.0, d + 0.022 + back],
            [11.0, 245.0, 8.0],
            leg,
            1.0,
            Skin(board.clone(), 0.2),
        );
    }
    put(
        room,
        &Shape::cuboid(),
        [x, y + half_h + 14.0, d - 0.005],
        [half_w - 20.0, 9.0, 14.0],
        upright(),
        1.0,
        Skin(board, 0.2),
    );
}

/// Strokes of all widths, a star, writing.
fn chart_picture() -> Canvas {
    let size = (1048, 860);
    let mut canvas = Canvas::new(size, PAPER);
    for (from, to) in [
        ([16., 16.], [1032., 16.]),
        ([1032., 16.], [1032., 844.]),
        ([1032., 844.], [16., 844.]),
        ([16., 844.], [16., 16.]),
    ] {
        canvas.stroke(from, to, 4.0, INK);
    }
    canvas.write("PHASEFRONT", [70.0, 62.0], 100.0, 10.0, INK);
    // A Siemens star.
    let (cx, cy, r) = (250.0f32, 430.0f32, 170.0f32);
    canvas.paint(|px, py| {
        let (dx, dy) = (px as f32 + 0.5 - cx, py as f32 + 0.5 - cy);
        let turns = dy.atan2(dx) / TAU as f32 + 0.5;
        (dx.hypot(dy) < r && (turns * 36.0).fract() < 0.5).then_some(INK)
    });
    // Line pairs, 24 texels (12 pixels) to 4 (2).
    let mut left = 480.0;
    for period in [24usize, 16, 12, 8, 6, 4] {
        let start = left as usize;
        canvas.paint(|px, py| {
            let inside = (start..start + 72).contains(&px);
            let along = (260..400).contains(&py) && (px - start.min(px)) % period < period / 2;
            let across = (420..560).contains(&py) && (py - 420usize.min(py)) % period < period / 2;
            (inside && (along || across)).then_some(INK)
        });
        left += 88.0;
    }
    for (index, colour) in [RED, ORANGE, YELLOW, GREEN, TEAL, BLUE, INK].into_iter().enumerate() {
        let from = 480 + index * 74;
        canvas.paint(|px, py| ((from..from + 66).contains(&px) && (578..612).contains(&py)).then_some(colour));
    }
    let lines = [
        "LIGHT IS A WAVE: EVERY POINT OF THIS ROOM",
        "SENDS ITS OWN, AND ONE PHASE HOLDS THEM ALL.",
        "FOCUS NEAR, AND THESE LINES ARE READ; FOCUS",
        "FAR, AND BRICK AND HILL AND CLOCK COME CLEAR.",
    ];
    let mut top = 646.0;
    for (line, height) in lines.into_iter().zip([25.5, 24.0, 24.0, 23.0]) {
        canvas.write(line, [78.0, top], height, height * 0.085, INK);
        top += height + 21.0;
    }
    canvas
}

fn multiply(a: [[f64; 3]; 3], b: [[f64; 3]; 3]) -> [[f64; 3]; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum()))
}

// ---- Pictures ----

fn mix(a: Colour, b: Colour, t: f32) -> Colour {
    std::array::from_fn(|c| a[c] + (b[c] - a[c]) * t)
}

/// A picture in the making.
struct Canvas {
    size: (usize, usize),
    pixels: Vec<Colour>,
}

impl Canvas {
    fn new(size: (usize, usize), colour: Colour) -> Self {
        Self {
            size,
            pixels: vec![colour; size.0 * size.1],
        }
    }

    fn wood(dice: &mut Dice, colour: Colour) -> Texture {
        let grain = Pattern::noise((128, 256), (16, 3), 4, 0.6, dice);
        grain.texture([mix(colour, [0.0; 3], 0.35), colour, mix(colour, [1.0; 3], 0.25)])
    }

    fn leaf(dice: &mut Dice, index: usize) -> Texture {
        let colour = mix([0.13, 0.38, 0.20], [0.42, 0.62, 0.26], dice.unit() as f32);
        let mut canvas = Self::new((64, 256), colour);
        canvas.paint(|px, py| {
            let vein = (py + px.abs_diff(32) + index * 7) % 16 < 3;
            let rib = px.abs_diff(32) < 3;
            Some(mix(
                colour,
                [0.72, 0.82, 0.50],
                if rib {
                    0.7
                } else if vein {
                    0.25
                } else {
                    0.0
                },
            ))
        });
        canvas.texture()
    }

    /// Where `colour` gives one, the pixel takes it.
    fn paint(&mut self, colour: impl Fn(usize, usize) -> Option<Colour>) {
        for (index, pixel) in self.pixels.iter_mut().enumerate() {
            if let Some(colour) = colour(index % self.size.0, index / self.size.0) {
                *pixel = colour;
            }
        }
    }

    fn stroke(&mut self, from: [f32; 2], to: [f32; 2], pen: f32, colour: Colour) {
        let mut ink = Pattern::from_fn(self.size, |_, _| 0.0);
        ink.stroke(from, to, pen);
        self.ink(&ink, colour);
    }

    /// Writes from `at`, the top-left corner, in capitals `height` high.
    fn write(&mut self, text: &str, at: [f32; 2], height: f32, pen: f32, colour: Colour) {
        let mut ink = Pattern::from_fn(self.size, |_, _| 0.0);
        let unit = height / 6.0;
        let mut left = at[0];
        for letter in text.chars() {
            for path in glyph(letter).split('|') {
                let place = |point: &str| {
                    let mut digits = point.chars().filter_map(|c| c.to_digit(10));
                    let (x, y) = (digits.next().unwrap_or(0), digits.next().unwrap_or(0));
                    [left + x as f32 * unit * 0.85, at[1] + y as f32 * unit]
                };
                let points: Vec<_> = path.split_whitespace().map(place).collect();
                points.windows(2).for_each(|pair| ink.stroke(pair[0], pair[1], pen));
                if let [dot] = points[..] {
                    ink.stroke(dot, dot, pen * 1.3);
                }
            }
            left += unit * if ".,:;I1".contains(letter) { 3.2 } else { 5.2 };
        }
        self.ink(&ink, colour);
    }

    fn ink(&mut self, ink: &Pattern, colour: Colour) {
        for (index, pixel) in self.pixels.iter_mut().enumerate() {
            *pixel = mix(*pixel, colour, ink.at(index % self.size.0, index / self.size.0));
        }
    }

    fn texture(&self) -> Texture {
        let texel = |colour: &Colour| {
            let [r, g, b] = colour.map(|v| (v.clamp(0.0, 1.0) * 255.0).round() as u8);
            [r, g, b, 255]
        };
        let texels = self.pixels.iter().map(texel).collect();
        Texture::new(self.size.0, self.size.1, texels).expect("a canvas has the texels of its size")
    }
}

/// The strokes of a capital, digit or stop: points xy on a grid 4 wide and 6 high, paths parted by bars.
fn glyph(letter: char) -> &'static str {
    match letter {
        'A' => "06 20 46|14 34",
        'B' => "00 06 36 45 44 33 03|33 42 41 30 00",
        'C' => "41 30 10 01 05 16 36 45",
        'D' => "00 06 26 44 42 20 00",
        'E' => "40 00 06 46|03 33",
        'F' => "40 00 06|03 33",
        'G' => "41 30 10 01 05 16 36 45 43 23",
        'H' => "00 06|40 46|03 43",
        'I' => "10 16",
        'J' => "40 45 36 16 05",
        'K' => "00 06|40 03 46",
        'L' => "00 06 46",
        'M' => "06 00 23 40 46",
        'N' => "06 00 46 40",
        'O' => "10 30 41 45 36 16 05 01 10",
        'P' => "06 00 30 41 42 33 03",
        'Q' => "10 30 41 45 36 16 05 01 10|24 46",
        'R' => "06 00 30 41 42 33 03|23 46",
        'S' => "41 30 10 01 02 13 33 44 45 36 16 05",
        'T' => "00 40|20 26",
        'U' => "00 05 16 36 45 40",
        'V' => "00 26 40",
        'W' => "00 16 23 36 40",
        'X' => "00 46|40 06",
        'Y' => "00 23 40|23 26",
        'Z' => "00 40 06 46",
        '0' => "10 30 41 45 36 16 05 01 10",
        '1' => "01 10 16",
        '2' => "01 10 30 41 42 06 46",
        '3' => "01 10 30 41 42 33 44 45 36 16 05|13 33",
        '4' => "36 30 04 44",
        '5' => "40 00 03 33 44 45 36 16 05",
        '6' => "41 30 10 01 05 16 36 45 44 33 13 04",
        '7' => "00 40 16",
        '8' => "13 02 01 10 30 41 42 33 13 04 05 16 36 45 44 33",
        '9' => "42 33 13 02 01 10 30 41 45 36 16 05",
        '.' => "16",
        ',' => "16 07",
        ';' => "12|16 07",
        ':' => "12|15",
        _ => "",
    }
}

// ---- Light ----

/// A distant light: toward it (x right, y up, z to the viewer, length one), and its brightness.
struct Sun {
    direction: [f64; 3],
    colour: Colour,
    /// Whether it makes highlights.
    lamp: bool,
}

/// A warm lamp from the upper left, wide enough for soft shadows, and a cool sky.
fn suns() -> Vec<Sun> {
    let unit = |v: [f64; 3]| {
        let length = (v[0] * v[0] + v[1] * v[1] + v[2] * v[2]).sqrt();
        v.map(|c| c / length)
    };
    let spiral = |index: usize, count: usize| {
        let (sin, cos) = (index as f64 * PI * (3.0 - 5f64.sqrt())).sin_cos();
        let r = ((index as f64 + 0.5) / count as f64).sqrt();
        [r * cos, r * sin]
    };
    let (lamps, skies) = (48, 72);
    let lamp = (0..lamps).map(|index| {
        let [a, b] = spiral(index, lamps);
        let share = 1.0 / lamps as f32;
        Sun {
            direction: unit([-0.50 + 0.09 * a, 0.62 + 0.09 * b, 0.72]),
            colour: [1.12, 1.02, 0.86].map(|v| v * share),
            lamp: true,
        }
    });
    let sky = (0..skies).map(|index| {
        // Even over the disc is Lambert's cosine over the hemisphere; its rim is left out.
        let [a, b] = spiral(index, skies).map(|v| 0.93 * v);
        let brightness = 0.50 * (1.0 + 0.45 * b as f32) / skies as f32;
        Sun {
            direction: [a, b, (1.0 - a * a - b * b).sqrt()],
            colour: [0.92, 0.98, 1.10].map(|v| v * brightness),
            lamp: false,
        }
    });
    lamp.chain(sky).collect()
}

/// The room as pixels: its colours lit by every sun that each point sees.
fn shaded(room: &[Item]) -> phasefront_lab::Result<RgbImage> {
    let (height, width) = (HEIGHT * FINE, WIDTH * FINE);
    let enlarged = |mesh: &Mesh| {
        let mut mesh = mesh.clone();
        mesh.positions
            .iter_mut()
            .for_each(|p| (p[0], p[1]) = (p[0] * FINE as f32, p[1] * FINE as f32));
        mesh
    };
    let pass = |texture: bool, colour: &dyn Fn(&Item) -> Vec<Colour>| {
        let meshes = room.iter().map(|item| {
            let mut mesh = enlarged(&item.mesh);
            if !texture {
                mesh.texture = Arc::new(Texture::plain([1.0; 3]));
            }
            mesh.colour = colour(item);
            mesh
        });
        render_ldi_reference(
            &Scene {
                meshes: meshes.collect(),
            },
            height,
            width,
            1,
        )
        .map(|mut ldi| ldi.layers.remove(0))
    };
    let albedo = pass(true, &|_| Vec::new())?;
    let normals = pass(false, &|item| {
        normals(&item.mesh)
            .iter()
            .map(|n| n.map(|v| (0.5 + 0.5 * v) as f32))
            .collect()
    })?;
    let gloss = pass(false, &|item| vec![[item.gloss, 0.0, 0.0]; item.mesh.positions.len()])?;
    let depth = albedo.depth;

    let light = light(room, &normals.rgb, &depth)?;
    Ok(RgbImage::from_fn(WIDTH as u32, HEIGHT as u32, |x, y| {
        let mut sum = [0.0f32; 3];
        for (dy, dx) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let (fy, fx) = (y as usize * FINE + dy, x as usize * FINE + dx);
            let light = light[fy * width + fx];
            let shine = 0.55 * gloss.rgb[[0, fy, fx]] * light[3];
            for (c, sum) in sum.iter_mut().enumerate() {
                *sum += film(albedo.rgb[[c, fy, fx]].powf(2.2) * light[c] + shine);
            }
        }
        Rgb(sum.map(|v| (255.0 * v / (FINE * FINE) as f32).round() as u8))
    }))
}

/// Red, green and blue light of each fine pixel, and the lamp's highlight.
fn light(room: &[Item], normals: &Array3<f32>, depth: &Array2<f32>) -> phasefront_lab::Result<Vec<[f32; 4]>> {
    let (height, width) = depth.dim();
    let mut light = vec![[0.0f32; 4]; height * width];
    let scene = Scene {
        meshes: room.iter().map(|item| item.mesh.clone()).collect(),
    };
    for sun in suns() {
        let shadow = Shadow::new(&scene, sun.direction)?;
        let half = {
            let [x, y, z] = sun.direction;
            let length = (x * x + y * y + (z + 1.0) * (z + 1.0)).sqrt();
            [x / length, y / length, (z + 1.0) / length]
        };
        light.par_chunks_mut(width).enumerate().for_each(|(y, row)| {
            for (x, light) in row.iter_mut().enumerate() {
                let n: [f64; 3] = std::array::from_fn(|c| 2.0 * f64::from(normals[[c, y, x]]) - 1.0);
                let cosine: f64 = (0..3).map(|i| n[i] * sun.direction[i]).sum();
                let place = [
                    (x as f64 + 0.5) / FINE as f64,
                    (y as f64 + 0.5) / FINE as f64,
                    f64::from(depth[[y, x]]),
                ];
                if cosine <= 0.0 || shadow.covers(place, cosine) {
                    continue;
                }
                // A sky's suns are spread by the cosine already; but toward the viewer, not along the surface's normal.
                let weight = if sun.lamp { cosine } else { cosine / sun.direction[2] } as f32;
                (0..3).for_each(|c| light[c] += weight * sun.colour[c]);
                if sun.lamp {
                    let facing: f64 = (0..3).map(|i| n[i] * half[i]).sum();
                    light[3] += sun.colour[0] * facing.max(0.0).powi(90) as f32;
                }
            }
        });
    }
    Ok(light)
}

/// Light to picture value: bright parts bend toward one.
fn film(light: f32) -> f32 {
    let exposed = 1.05 * light;
    let bent = if exposed < 0.7 {
        exposed
    } else {
        0.7 + 0.3 * (1.0 - (-(exposed - 0.7) / 0.3).exp())
    };
    bent.powf(1.0 / 2.2)
}

/// Smooth normals: x right, y up, z to the viewer.
fn normals(mesh: &Mesh) -> Vec<[f64; 3]> {
    let point = |index: u32| {
        let [x, y, z] = mesh.positions[index as usize].map(f64::from);
        [x, -y, z * VOLUME_PX]
    };
    let mut sums = vec![[0.0f64; 3]; mesh.positions.len()];
    for t in &mesh.triangles {
        let [a, b, c] = t.map(point);
        let (u, v): ([f64; 3], [f64; 3]) = (
            std::array::from_fn(|i| b[i] - a[i]),
            std::array::from_fn(|i| c[i] - a[i]),
        );
        let normal = [
            u[1] * v[2] - u[2] * v[1],
            u[2] * v[0] - u[0] * v[2],
            u[0] * v[1] - u[1] * v[0],
        ];
        for &index in t {
            (0..3).for_each(|i| sums[index as usize][i] += normal[i]);
        }
    }
    sums.iter()
        .map(|n| n.map(|v| v / (n[0] * n[0] + n[1] * n[1] + n[2] * n[2]).sqrt().max(1e-9)))
        .collect()
}

/// What a sun sees: the scene sheared so that its rays run along z.
struct Shadow {
    depth: Array2<f32>,
    /// Pixels that a whole volume's depth is sheared by: right and down.
    shear: [f64; 2],
    margin: [usize; 2],
}

impl Shadow {
    fn new(scene: &Scene, direction: [f64; 3]) -> phasefront_lab::Result<Self> {
        let shear = [
            -direction[0] / direction[2] * VOLUME_PX,
            direction[1] / direction[2] * VOLUME_PX,
        ];
        let margin = shear.map(|s| (s.abs() / 2.0).ceil() as usize + 1);
        let mut scene = scene.clone();
        for p in scene.meshes.iter_mut().flat_map(|mesh| &mut mesh.positions) {
            (0..2).for_each(|i| p[i] += (f64::from(p[2]) * shear[i] + margin[i] as f64) as f32);
        }
        let mut ldi = render_ldi_reference(&scene, HEIGHT + 2 * margin[1], WIDTH + 2 * margin[0], 1)?;
        Ok(Self {
            depth: ldi.layers.remove(0).depth,
            shear,
            margin,
        })
    }

    /// Whether something lies between the sun and the surface at pixel (x, y) and depth d, which it meets with
    /// `cosine`.
    fn covers(&self, [x, y, d]: [f64; 3], cosine: f64) -> bool {
        let [u, v] = [0, 1].map(|i| [x, y][i] + (0.5 - d) * self.shear[i] + self.margin[i] as f64);
        let (rows, columns) = self.depth.dim();
        let inside = u >= 0.0 && v >= 0.0 && (u as usize) < columns && (v as usize) < rows;
        // The surface itself is seen a pixel off, at another depth where it is steep.
        let slack = (0.004 + 0.0015 / cosine.max(0.1)) as f32;
        inside && self.depth[[v as usize, u as usize]] < d as f32 - slack
    }
}
