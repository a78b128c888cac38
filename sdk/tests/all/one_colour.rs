//! Checks that a display with one laser gives the same result as that laser among three. The results are equal to the
//! bit if that laser has the longest wavelength of the three, for which the shared parts are planned.
use crate::camera;
use crate::network_models;
use phasefront::Size;

use camera::{Scene, frame};
use ndarray::{Array2, Array3, s};
use network_models::Model;
use num_complex::Complex32;
use phasefront::input::DepthFormat;
use phasefront::output::{Layout, Levels, Output, Placement};
use phasefront::target::{Aberration, Illumination, Response};
use phasefront::{
    Brightness, Display, EncoderOptions, Encoding, Method, Network, Pipeline, RgbdFrame, SessionOptions, Sweep, Target,
    VideoSession,
};
use phasefront_core::display::levels::LevelsMut;
use phasefront_core::display::panel::Flatness;
use phasefront_core::display::panel::Panel;
use phasefront_core::display::registration::Registration;
use phasefront_core::display::response::per_pixel;
use phasefront_core::display::response::per_pixel::PerPixel;
use phasefront_core::encode::Encoder;
use phasefront_core::view::preview::Preview;
use phasefront_core::view::refocus::{Refocus, phase_only_field};
use std::sync::Arc;

const W: usize = 75;
const H: usize = 46;
const SIZE: usize = W * H;
const THREE: &str = "[638, 520, 450]";
const ONE: &str = "[638]";

fn display(wavelengths_nm: &str, offset_mm: f64) -> Display {
    let text = format!("width = {W}\nheight = {H}\noffset_mm = {offset_mm:?}\nwavelengths_nm = {wavelengths_nm}");
    Display::from_toml(&text).unwrap()
}

/// Returns a frame of surfaces with edges, with the first `colours` of three planes.
fn rgbd(colours: usize) -> RgbdFrame {
    let rgb = Array3::from_shape_fn((colours, H, W), |(c, y, x)| {
        ((c * 5 + y * 3 + x * x + y * x) % 11) as f32 / 10.0
    });
    RgbdFrame::new(rgb, depth()).unwrap()
}

fn depth() -> Array2<f32> {
    Array2::from_shape_fn((H, W), |(y, x)| match ((x / 19) + (y / 15)) % 3 {
        0 => 0.15,
        1 => 0.4 + 0.3 * y as f32 / H as f32,
        _ => 0.9,
    })
}

/// Returns a target with every part that a calibration and a test bench can add, the same in all colours except the
/// look-up tables.
fn calibrated(wavelengths_nm: &str, offset_mm: f64) -> Target {
    let display = display(wavelengths_nm, offset_mm);
    let colours = display.colours();
    let (rows, columns) = per_pixel::nodes(Size { width: W, height: H }, 8);
    let nodes = colours * rows * columns;
    let table: Vec<f32> = (0..9 * nodes)
        .map(|i| (i / 9 % 7) as f32 + (i % 9) as f32 * 31.0)
        .collect();
    let table = PerPixel::new(Size { width: W, height: H }, 8, 8, &table, &vec![6.1; nodes]).unwrap();
    let light = Array3::from_shape_fn((3, 4, 5), |(c, y, x)| 1.0 / (1.0 + (c + y * 2 + x) as f32 / 20.0));
    let flatness = Flatness::new(
        Size { width: W, height: H },
        (0..SIZE).map(|i| (31 * i) as u16).collect(),
    )
    .unwrap();
    Target {
        response: Response::PerPixel(table.into()),
        illumination: Some(Illumination::new(light.slice(s![..colours, .., ..])).unwrap()),
        correction: Some(Aberration::new(vec![[0.3, 0.8, -0.4, 0.2, 0.1]; colours]).unwrap()),
        panel: Panel {
            carrier_rad: [4e-3, 1e-3],
            lens_m: Some(0.4),
            flatness: Some(flatness),
            levels_turns: None,
        },
        registration: Registration {
            shift_px: [[1.5, -0.25], [0.0, 0.0], [2.0, 0.0]][..colours].into(),
            scale: [1.002, 1.0, 0.99][..colours].into(),
        },
        ..Target::from(display)
    }
}

fn options(encoding: Encoding, midpoint_steps: usize) -> EncoderOptions {
    EncoderOptions {
        brightness: Brightness::Fixed(1.1),
        midpoint_steps,
        ..encoding.into()
    }
}

/// Returns the field at the modulator, and the levels.
fn made(frame: &RgbdFrame, method: Method, target: &Target, options: &EncoderOptions) -> (Vec<Complex32>, Vec<u8>) {
    let pipeline = Pipeline::new(Size { width: W, height: H }, method, target, options).unwrap();
    assert_eq!(pipeline.colours(), frame.colours());
    let values = pipeline.colours() * SIZE;
    let (mut field, mut levels) = (vec![Complex32::ZERO; values], vec![0; values]);
    let mut scratch = pipeline.scratch();
    pipeline.field(frame, &mut field, &mut scratch).unwrap();
    let kept = field.clone();
    pipeline.modulate(None, &mut field, LevelsMut::Bytes(&mut levels), &mut scratch);
    (kept, levels)
}

#[test]
fn every_stage_gives_one_laser_the_bits_that_it_has_among_three() {
    // The sweep runs to the modulator or to the midpoint.
    for offset_mm in [0.0, 3.0, 9.0] {
        for (encoding, midpoint_steps) in [
            (Encoding::DoublePhase, 0),
            (Encoding::ANTI_ALIAS, 0),
            (Encoding::ANTI_ALIAS, 2),
            (Encoding::BAND_LIMIT, 0),
        ] {
            let options = options(encoding, midpoint_steps);
            let sweep = Method::Sweep(Sweep::for_display(&display(ONE, offset_mm)));
            for of in [
                |nm: &str, mm: f64| Target::from(display(nm, mm)),
                |nm: &str, mm: f64| calibrated(nm, mm),
            ] {
                let (field, levels) = made(&rgbd(1), sweep.clone(), &of(ONE, offset_mm), &options);
                let among = made(&rgbd(3), sweep.clone(), &of(THREE, offset_mm), &options);
                assert!(field == among.0[..SIZE], "{offset_mm} {options:?}");
                assert!(levels == among.1[..SIZE], "{offset_mm} {options:?}");
            }
        }
    }
}

/// Green shares the plans made for red and gives the same light up to rounding. Hidden surfaces are left out, because
/// their search radius is the reach of red's light.
#[test]
fn a_laser_in_the_middle_of_three_gives_the_same_light() {
    let options = options(Encoding::ANTI_ALIAS, 0);
    // At large offsets, light that wraps around the padding differs between a plan for red and one for green.
    for (offset_mm, most) in [(0.0, 1e-3), (9.0, 0.05)] {
        let [one, three] = ["[532]", "[638, 532, 450]"].map(|nm| display(nm, offset_mm));
        let sweep = Method::Sweep(Sweep {
            hidden_layers: 0,
            ..Sweep::for_display(&three)
        });
        let green = rgbd(3).rgb().slice(s![1..2, .., ..]).to_owned();
        let frame = RgbdFrame::new(green, depth()).unwrap();
        let (field, levels) = made(&frame, sweep.clone(), &one.into(), &options);
        let among = made(&rgbd(3), sweep, &three.into(), &options);
        let apart = |(a, b): (&Complex32, &Complex32)| (a - b).norm();
        let worst = field.iter().zip(&among.0[SIZE..]).map(apart).fold(0.0, f32::max);
        assert!(worst < most, "{offset_mm}: {worst}");
        let other = levels.iter().zip(&among.1[SIZE..]).filter(|(a, b)| a != b).count();
        assert!(other * 50 < SIZE || offset_mm > 0.0, "{other} of {SIZE} levels");
    }
}

fn network(model: &Model) -> Arc<Network> {
    Arc::new(Network::from_onnx(&model.bytes()).unwrap())
}

#[test]
fn a_network_sees_grey_and_gives_the_colour_of_the_nearest_wavelength() {
    let grey = rgbd(1);
    let options = options(Encoding::ANTI_ALIAS, 0);
    let tanh = Model {
        tanh: true,
        head: "amplitude-phase",
        ..Model::new(4, 8)
    };
    // The last network runs on tract.
    for model in [Model::int8(5, 8), Model::new(6, 12), tanh, Model::new(3, 5)] {
        let network = network(&model);
        for (wavelengths_nm, colour) in [("[638]", 0), ("[520]", 1), ("[450]", 2)] {
            let one = display(wavelengths_nm, 0.0);
            assert_eq!(network.colour(&one).unwrap(), Some(colour));
            let (field, _) = made(&grey, Method::trained(network.clone()), &one.into(), &options);
            let three = display(THREE, 0.0);
            let frame = grey.clone().for_display(&three);
            let (among, _) = made(&frame, Method::trained(network.clone()), &three.into(), &options);
            assert!(field == among[colour * SIZE..][..SIZE], "{wavelengths_nm} {network:?}");
        }
    }
}

#[test]
fn a_network_serves_a_laser_within_the_depths_that_it_was_trained_for() {
    let network = network(&Model::new(3, 8));
    let of = |text: &str| Display::from_toml(text).unwrap();
    for (text, colour, scale) in [
        // Green's depth range would have to be longer.
        ("wavelengths_nm = [532]", 0, 532.0 / 638.0),
        (
            "wavelengths_nm = [532]\nvolume_depth_mm = 5",
            1,
            532.0 / 520.0 * 5.0 / 6.0,
        ),
        ("wavelengths_nm = [515]", 1, 515.0 / 520.0),
        (
            "wavelengths_nm = [780]\nvolume_depth_mm = 4",
            0,
            780.0 / 638.0 * 4.0 / 6.0,
        ),
        ("wavelengths_nm = [405]", 2, 405.0 / 450.0),
    ] {
        let display = of(text);
        assert_eq!(network.colour(&display).unwrap(), Some(colour), "{text}");
        let stretch = network.depth_scale(&display).unwrap();
        assert!((f64::from(stretch) - scale).abs() < 1e-6, "{text}: {stretch}");
    }
    assert_eq!(network.colour(&Display::default()).unwrap(), None);
    let why = network
        .check_display(&of("wavelengths_nm = [780]"))
        .unwrap_err()
        .to_string();
    assert!(why.contains("1.22 times the range"), "{why}");
    // A frame with another number of colours is refused.
    let target = Target::from(display(ONE, 0.0));
    let plan = Pipeline::new(
        Size { width: W, height: H },
        Method::Network(network),
        &target,
        &Encoding::ANTI_ALIAS.into(),
    )
    .unwrap();
    let mut field = vec![Complex32::ZERO; SIZE];
    let refused = plan.field(&rgbd(3), &mut field, &mut plan.scratch());
    assert!(refused.unwrap_err().to_string().contains("for_display"));
}

#[test]
fn a_pre_filter_sees_the_field_as_all_colours() {
    let wave: Vec<_> = (0..SIZE)
        .map(|i| Complex32::from_polar(0.3 + (i % 13) as f32 / 20.0, (i / W) as f32 * 0.1))
        .collect();
    let blurred = Model {
        int8: true,
        inputs: 12,
        input: "split-blurred-field",
        ..Model::prefilter("2")
    };
    for model in [Model::prefilter("2"), blurred] {
        let encoding = Encoding::Deep(network(&model));
        let phases = |wavelengths_nm: &str| {
            let target = Target::from(display(wavelengths_nm, 2.0));
            let encoder = Encoder::new(Size { width: W, height: H }, &target, &encoding.clone().into()).unwrap();
            let mut field = wave.repeat(target.display.colours());
            let mut phases = vec![0.0; field.len()];
            encoder.encode(&mut field, Some(1.0), &mut phases, &mut encoder.scratch());
            phases
        };
        let among = phases(THREE);
        for (colour, wavelengths_nm) in ["[638]", "[520]", "[450]"].into_iter().enumerate() {
            assert!(
                phases(wavelengths_nm) == among[colour * SIZE..][..SIZE],
                "{wavelengths_nm}"
            );
        }
    }
}

#[test]
fn views_and_images_of_one_laser_are_those_of_its_colour() {
    let z_m = [-2e-3, 0.0, 1e-3];
    for offset_mm in [0.0, 3.0] {
        let [one, three] = [ONE, THREE].map(|nm| Target::from(display(nm, offset_mm)));
        let options = options(Encoding::ANTI_ALIAS, 0);
        let sweep = Method::Sweep(Sweep::for_display(&one.display));
        let (_, levels) = made(&rgbd(1), sweep.clone(), &one, &options);
        let (_, among) = made(&rgbd(3), sweep, &three, &options);
        let views = |target: &Target, levels: &[u8]| {
            let mut field = vec![Complex32::ZERO; levels.len()];
            phase_only_field(levels, &target.response, 1.1, &mut field);
            let plan = Refocus::new(Size { width: W, height: H }, &target.display, &z_m, None).unwrap();
            plan.focal_stack(&field, &z_m).unwrap()
        };
        for (view, among) in views(&one, &levels).iter().zip(views(&three, &among)) {
            assert!(*view == among[..SIZE], "{offset_mm}");
        }
        let preview = |target: &Target, levels: &[u8]| {
            let plan = Preview::new(
                Size { width: W, height: H },
                target,
                1e-3,
                Size { width: 30, height: 20 },
            )
            .unwrap();
            let mut rgba = vec![0; 4 * 20 * 30];
            let image = (Layout::Rgba, &mut rgba[..], 120);
            plan.look(levels, 1.1, image, &mut plan.scratch()).unwrap();
            rgba
        };
        let pixels = preview(&one, &levels);
        for (pixel, among) in pixels.chunks_exact(4).zip(preview(&three, &among).chunks_exact(4)) {
            assert_eq!(pixel, [among[0], among[0], among[0], 255]);
        }
    }
    images(&Target::from(display(ONE, 0.0)), &Target::from(display(THREE, 0.0)));
    images(&calibrated(ONE, 0.0), &calibrated(THREE, 0.0));
}

/// Checks the output images of holograms smaller than the modulator, which are surrounded by black.
fn images(one: &Target, three: &Target) {
    let (h, w) = (H - 6, W - 9);
    let size = Size { width: w, height: h };
    let levels: Vec<u8> = (0..3 * h * w).map(|i| (i * 7 % 251) as u8).collect();
    for layout in [Layout::Rgb, Layout::Bgra, Layout::Rgb10, Layout::Grey, Layout::Grey16] {
        let image = |target: &Target, levels: &[u8]| {
            let plan = Output::new(target, size, Placement::centred(layout)).unwrap();
            let mut bytes = vec![0; plan.image_bytes()];
            plan.write(Levels::Bytes(levels), 0, &mut bytes, plan.row_bytes())
                .unwrap();
            let mut read = vec![0; levels.len()];
            plan.read(&bytes, 0, &mut read).unwrap();
            (bytes, read)
        };
        let (bytes, read) = image(one, &levels[..h * w]);
        assert!(read.iter().zip(&levels).all(|(read, level)| *read == u16::from(*level)));
        // The image equals that of three equal colours, unless each colour has its own table.
        if one.response.size().is_none() || layout.images(3) == 3 {
            assert!(bytes == image(three, &levels[..h * w].repeat(3)).0, "{layout:?}");
        }
        assert_eq!(layout.images(1), 1);
        let plan = Output::new(one, size, Placement::centred(layout)).unwrap();
        let refused = plan.write(Levels::Bytes(&levels[..h * w]), 1, &mut bytes.clone(), plan.row_bytes());
        assert!(refused.unwrap_err().to_string().contains("no image 1"));
    }
}

#[test]
fn a_session_shows_a_pictures_luminance() {
    let session = |wavelengths_nm: &str| {
        let display = display(wavelengths_nm, 2.0);
        let method = Method::Sweep(Sweep::for_display(&display));
        let mut options = SessionOptions::new(display, method);
        options.encoder.brightness = Brightness::Fixed(1.1);
        VideoSession::new(options).unwrap()
    };
    let (one, three) = (session(ONE), session(THREE));
    one.warm_up().unwrap();
    for time in 0..2u64 {
        let mut scene = Scene::new(Size { width: W, height: H }, 10 + 5 * time as usize);
        // The scene is grey, so that the luminance equals each colour.
        for pixel in scene.rgba.chunks_exact_mut(4) {
            let green = pixel[1];
            pixel[..3].fill(green);
        }
        let metres = scene.depth_bytes(DepthFormat::MetresF32);
        let [alone, among] = [&one, &three].map(|session| {
            let frame = frame(1 + 33_000_000 * time, &scene, &metres);
            session.process(&frame).unwrap()
        });
        assert_eq!((alone.colours(), alone.levels().len()), (1, SIZE));
        assert_eq!(alone.plane(0).unwrap(), alone.levels());
        assert!(alone.plane(1).unwrap_err().to_string().contains("one laser"));
        assert_eq!(alone.z_at(0.3, 0.4), among.z_at(0.3, 0.4));
        let red = among.plane(0).unwrap();
        let far = |(a, b): &(&u8, &u8)| a.wrapping_sub(**b).wrapping_add(1) > 2;
        let other = alone.levels().iter().zip(red).filter(far).count();
        assert!(other * 100 < SIZE, "{other} of {SIZE}");
        let mut rgba = vec![0; 4 * 20 * 30];
        alone
            .write_preview(1e-3, Size { width: 30, height: 20 }, Layout::Rgba, &mut rgba, 120)
            .unwrap();
        let is_grey = |p: &[u8]| p[0] == p[1] && p[1] == p[2] && p[3] == 255;
        assert!(rgba.chunks_exact(4).all(is_grey) && rgba.iter().any(|value| (30..200).contains(value)));
    }
}

#[test]
fn levels_of_ten_bits_are_made_for_one_laser() {
    let text = |nm: &str| format!("width = {W}\nheight = {H}\nbits = 10\nwavelengths_nm = {nm}");
    let words = |nm: &str| {
        let display = Display::from_toml(&text(nm)).unwrap();
        let method = Method::Sweep(Sweep::for_display(&display));
        let (colours, options) = (display.colours(), options(Encoding::ANTI_ALIAS, 0));
        let plan = Pipeline::new(Size { width: W, height: H }, method, &display.into(), &options).unwrap();
        let mut scratch = plan.scratch();
        let mut words = vec![0; colours * SIZE];
        let out = LevelsMut::Words(&mut words);
        plan.process_after(None, &rgbd(colours), out, &mut scratch).unwrap();
        words
    };
    assert!(words(ONE) == words(THREE)[..SIZE]);
}
