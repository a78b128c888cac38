//! Captures of links with known faults, rebuilt from the pattern, and of links without any.

#![allow(clippy::unwrap_used)]
use super::*;
use crate::simulated_display::normal;
use phasefront_io::dice::Dice;
use phasefront_io::hologram::packed::Kind;

const SIZES: [Size; 2] = [
    Size {
        width: 640,
        height: 480,
    },
    Size {
        width: 1280,
        height: 800,
    },
];

/// A picture of the pattern on its way.
type Picture = Vec<[f64; 3]>;
type Link = Box<dyn Fn(Picture, Size) -> Picture + Sync>;

fn sent(size: Size) -> Picture {
    let layout = Layout { size };
    let places = (0..size.height).flat_map(|y| (0..size.width).map(move |x| (y, x)));
    places.map(|(y, x)| layout.pixel(y, x).map(f64::from)).collect()
}

fn captured(picture: &[[f64; 3]], size: Size) -> Image {
    let byte = |value: &f64| value.round().clamp(0.0, 255.0) as u8;
    Image {
        size,
        bytes: picture.as_flattened().iter().map(byte).collect(),
        kind: Kind::Rgb,
    }
}

/// Makes a link that changes each pixel by itself.
fn pixels(change: impl Fn([f64; 3]) -> [f64; 3] + Sync + 'static) -> Link {
    Box::new(move |picture, _| picture.into_iter().map(&change).collect())
}

/// Makes a link whose pixel (y, x) is made by `change` from a function that reads the sent picture. Outside the
/// picture, the nearest pixel is read.
fn places(change: impl Fn(&dyn Fn(i64, i64) -> [f64; 3], i64, i64, Size) -> [f64; 3] + Sync + 'static) -> Link {
    Box::new(move |picture, size| {
        let at = |y: i64, x: i64| {
            let y = y.clamp(0, size.height as i64 - 1) as usize;
            let x = x.clamp(0, size.width as i64 - 1) as usize;
            picture[y * size.width + x]
        };
        let all = (0..size.height as i64).flat_map(|y| (0..size.width as i64).map(move |x| (y, x)));
        all.map(|(y, x)| change(&at, y, x, size)).collect()
    })
}

fn mix(a: [f64; 3], b: [f64; 3], part: f64) -> [f64; 3] {
    std::array::from_fn(|c| a[c] * (1.0 - part) + b[c] * part)
}

/// Enlarges about the middle by linear interpolation, with black outside.
fn zoomed(zoom_x: f64, zoom_y: f64) -> Link {
    places(move |at, y, x, size| {
        let place = |at: i64, length: usize, zoom: f64| {
            (at as f64 + 0.5 - length as f64 / 2.0) / zoom + length as f64 / 2.0 - 0.5
        };
        let (v, u) = (place(y, size.height, zoom_y), place(x, size.width, zoom_x));
        if v < -0.5 || u < -0.5 || v > size.height as f64 - 0.5 || u > size.width as f64 - 0.5 {
            return [0.0; 3];
        }
        let row = |y: i64| mix(at(y, u.floor() as i64), at(y, u.floor() as i64 + 1), u - u.floor());
        mix(row(v.floor() as i64), row(v.floor() as i64 + 1), v - v.floor())
    })
}

/// Resizes lines to `factor` times as many and back, by linear interpolation.
fn resampled(line: &[[f64; 3]], factor: f64) -> Picture {
    let resize = |line: &[[f64; 3]], count: usize| -> Picture {
        (0..count)
            .map(|at| {
                let place = ((at as f64 + 0.5) * line.len() as f64 / count as f64 - 0.5).max(0.0);
                let next = line[(place as usize + 1).min(line.len() - 1)];
                mix(line[place as usize], next, place.fract()).map(f64::round)
            })
            .collect()
    };
    resize(&resize(line, (line.len() as f64 * factor).round() as usize), line.len())
}

fn rows_resampled(factor: f64) -> Link {
    Box::new(move |mut picture, size| {
        for x in 0..size.width {
            let column: Picture = (0..size.height).map(|y| picture[y * size.width + x]).collect();
            for (y, pixel) in resampled(&column, factor).into_iter().enumerate() {
                picture[y * size.width + x] = pixel;
            }
        }
        picture
    })
}

fn columns_resampled(factor: f64) -> Link {
    Box::new(move |picture, size| {
        let rows = picture.chunks_exact(size.width);
        rows.flat_map(|row| resampled(row, factor)).collect()
    })
}

/// Filters with three weights along each axis, of which the outer ones are `x` and `y`.
fn filtered(x: f64, y: f64) -> Link {
    places(move |at, v, u, _| {
        let row = |v: i64| -> [f64; 3] {
            std::array::from_fn(|c| at(v, u)[c] * (1.0 - 2.0 * x) + x * (at(v, u - 1)[c] + at(v, u + 1)[c]))
        };
        let (above, here, below) = (row(v - 1), row(v), row(v + 1));
        std::array::from_fn(|c| here[c] * (1.0 - 2.0 * y) + y * (above[c] + below[c]))
    })
}

/// Draws a bar with symbols over a rectangle.
fn bar(inside: impl Fn(i64, i64, Size) -> bool + Sync + 'static) -> Link {
    places(move |at, y, x, size| match inside(y, x, size) {
        true if (x / 20 + y / 20) % 5 == 0 => [90.0, 120.0, 200.0],
        true => [24.0, 26.0, 30.0],
        false => at(y, x),
    })
}

fn to_ycbcr([r, g, b]: [f64; 3]) -> [f64; 3] {
    let y = 0.2126 * r + 0.7152 * g + 0.0722 * b;
    [y, (b - y) / 1.8556 + 128.0, (r - y) / 1.5748 + 128.0].map(f64::round)
}

fn from_ycbcr([y, cb, cr]: [f64; 3]) -> [f64; 3] {
    let (cb, cr) = (cb - 128.0, cr - 128.0);
    [y + 1.5748 * cr, y - 0.1873 * cb - 0.4681 * cr, y + 1.8556 * cb]
}

/// Makes a link of 8-bit YCbCr (BT.709) whose colours are shared by `wide`×`high` pixels.
fn ycbcr(wide: i64, high: i64) -> Link {
    places(move |at, y, x, _| {
        let (first_y, first_x) = (y / high * high, x / wide * wide);
        let shared = (0..high).flat_map(|v| (0..wide).map(move |u| (first_y + v, first_x + u)));
        let mut mean = [0.0; 3];
        for (v, u) in shared {
            let other = to_ycbcr(at(v, u));
            mean = std::array::from_fn(|c| mean[c] + other[c] / (wide * high) as f64);
        }
        from_ycbcr([to_ycbcr(at(y, x))[0], mean[1].round(), mean[2].round()])
    })
}

/// Keeps `bits` bits of each level and fills the others as a screen does, or with zeros.
fn bits(bits: u32, fills: bool) -> Link {
    pixels(move |rgb| {
        rgb.map(|value| {
            let high = (value as u8 >> (8 - bits)) as f64;
            if fills {
                high * 255.0 / f64::from((1 << bits) - 1)
            } else {
                high * f64::from(1 << (8 - bits))
            }
        })
    })
}

/// Adds the dither pattern of a panel of 6 bits.
fn dithered() -> Link {
    places(|at, y, x, _| {
        let threshold = [[0.0, 2.0], [3.0, 1.0]][(y % 2) as usize][(x % 2) as usize];
        at(y, x).map(|value| ((value + threshold) / 4.0).floor() * 4.0)
    })
}

fn turned(flip_x: bool, flip_y: bool) -> Link {
    places(move |at, y, x, size| {
        let x = if flip_x { size.width as i64 - 1 - x } else { x };
        let y = if flip_y { size.height as i64 - 1 - y } else { y };
        at(y, x)
    })
}

fn reordered(order: [usize; 3]) -> Link {
    pixels(move |rgb| order.map(|c| rgb[c]))
}

fn gamma(by: [f64; 3]) -> Link {
    pixels(move |rgb| std::array::from_fn(|c| 255.0 * (rgb[c] / 255.0).powf(by[c])))
}

fn range(black: f64, white: f64) -> Link {
    pixels(move |rgb| rgb.map(|value| black + value * (white - black) / 255.0))
}

/// The faults by name, with three amounts of each.
fn faulty() -> Vec<(&'static str, [Link; 3])> {
    let high = |size: Size| size.height as i64;
    vec![
        ("rows resampled", [10.0 / 9.0, 35.0 / 36.0, 0.8].map(rows_resampled)),
        ("rows resampled", [1.11, 1.01, 0.96].map(|zoom| zoomed(1.0, zoom))),
        ("columns resampled", [10.0 / 9.0, 0.95, 0.7].map(columns_resampled)),
        ("overscan", [1.01, 1.03, 1.07].map(|zoom| zoomed(zoom, zoom))),
        ("underscan", [0.99, 0.97, 0.92].map(|zoom| zoomed(zoom, zoom))),
        (
            "shifted",
            [1, 4, 17].map(|by| places(move |at, y, x, _| at(y - by, x - by))),
        ),
        ("vertical blur", [0.02, 0.1, 0.25].map(|by| filtered(0.0, by))),
        ("horizontal blur", [0.02, 0.1, 0.25].map(|by| filtered(by, 0.0))),
        ("blur", [0.02, 0.1, 0.25].map(|by| filtered(by, by))),
        ("sharpening", [-0.02, -0.1, -0.3].map(|by| filtered(by, by))),
        ("sharpening", [-0.02, -0.1, -0.3].map(|by| filtered(by, 0.0))),
        ("BGR", [[2, 1, 0]; 3].map(reordered)),
        ("colours swapped", [[1, 0, 2], [0, 2, 1], [1, 2, 0]].map(reordered)),
        ("mirrored left to right", [(); 3].map(|()| turned(true, false))),
        ("mirrored top to bottom", [(); 3].map(|()| turned(false, true))),
        ("rotated by 180°", [(); 3].map(|()| turned(true, true))),
        (
            "taskbar",
            [24, 40, 64].map(|rows| bar(move |y, _, size| y >= high(size) - rows)),
        ),
        ("taskbar", [24, 40, 64].map(|rows| bar(move |y, _, _| y < rows))),
        (
            "taskbar",
            [24, 48, 70].map(|columns| bar(move |_, x, size| x >= size.width as i64 - columns)),
        ),
        (
            "covered",
            [16, 60, 150]
                .map(|side| bar(move |y, x, _| (90..90 + side).contains(&y) && (200..200 + 2 * side).contains(&x))),
        ),
        ("6 bits", [bits(6, true), bits(6, false), dithered()]),
        ("5 bits", [bits(5, true), bits(5, false), bits(5, true)]),
        ("7 bits", [bits(7, true), bits(7, false), bits(7, true)]),
        ("limited range", [16.0, 15.5, 16.4].map(|black| range(black, 235.0))),
        (
            "full range taken for limited",
            [0.0, 0.3, -0.3].map(|by| range(-18.63 + by, 278.29 + by)),
        ),
        ("tone curve", [[1.05; 3], [1.2; 3], [0.8; 3]].map(gamma)),
        (
            "tone curve",
            [[1.0, 1.0, 1.1], [1.0, 1.1, 1.4], [1.0, 1.03, 1.05]].map(gamma),
        ),
        ("YCbCr or a colour profile", [(); 3].map(|()| ycbcr(1, 1))),
        ("YCbCr 4:2:2", [(); 3].map(|()| ycbcr(2, 1))),
        ("YCbCr 4:2:0", [(); 3].map(|()| ycbcr(2, 2))),
    ]
}

/// Adds the noise of a camera, of standard deviation `sigma`.
fn with_noise(mut picture: Picture, sigma: f64, dice: &mut Dice) -> Picture {
    (picture.as_flattened_mut().iter_mut()).for_each(|value| *value += sigma * normal(dice));
    picture
}

fn names(picture: &[[f64; 3]], size: Size) -> Vec<String> {
    let Some(reading) = read(&captured(picture, size), size) else {
        return vec!["not the pattern".into()];
    };
    let name = |fault: &String| fault.split_once(':').unwrap().0.to_owned();
    // "YCbCr 4:2:2" has a colon of its own.
    let whole = |fault: &String| {
        let end = fault.find(": ").unwrap();
        fault[..end].to_owned()
    };
    reading
        .faults
        .iter()
        .map(|fault| {
            if fault.starts_with("YCbCr 4") {
                whole(fault)
            } else {
                name(fault)
            }
        })
        .collect()
}

fn check(size: Size, sigma: f64) {
    let mut wrong = Vec::new();
    let mut dice = Dice::new(7);
    let sent = sent(size);
    for (name, links) in faulty() {
        for (amount, link) in links.iter().enumerate() {
            // Under noise, dithering looks like noise, and the rounding of a conversion to YCbCr is smaller.
            if sigma > 0.0 && (name == "6 bits" && amount == 2 || name == "YCbCr or a colour profile") {
                continue;
            }
            let mut picture = link(sent.clone(), size);
            if sigma > 0.0 {
                picture = with_noise(picture, sigma, &mut dice);
            }
            let found = names(&picture, size);
            if found != [name] {
                wrong.push(format!("{name}, amount {amount}: {found:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{size}, noise {sigma}:\n{}", wrong.join("\n"));
}

#[test]
fn each_fault_is_named_and_no_other_in_a_small_frame() {
    check(SIZES[0], 0.0);
}

#[test]
#[ignore = "slow: 25 seconds of a core"]
fn each_fault_is_named_and_no_other_in_a_large_frame() {
    check(SIZES[1], 0.0);
}

#[test]
#[ignore = "slow: 10 seconds of a core"]
fn each_fault_is_named_and_no_other_under_noise() {
    check(SIZES[0], 1.5);
}

#[test]
fn good_captures_with_noise_have_no_fault() {
    let mut dice = Dice::new(11);
    for n in 0..50 {
        let size = SIZES[usize::from(n % 10 == 0)];
        let sigma = f64::from(n) * 0.1;
        let picture = with_noise(sent(size), sigma, &mut dice);
        assert_eq!(names(&picture, size), Vec::<String>::new(), "{size}, noise {sigma}");
    }
}

#[test]
fn a_link_that_changes_nothing_has_no_fault() {
    for size in [
        Size { width: 512, height: 96 },
        Size {
            width: 641,
            height: 481,
        },
    ] {
        let reading = read(&pattern(size), size).unwrap();
        assert_eq!((reading.range, reading.bits, reading.noise), (Range::Full, 8, 0.0));
        assert_eq!(reading.faults, Vec::<String>::new());
        for contrast in [
            reading.columns,
            reading.rows,
            reading.colour_columns,
            reading.colour_rows,
        ] {
            assert!((contrast.unwrap() - 1.0).abs() < 1e-9, "{contrast:?}");
        }
        assert!(reading.grey_error[1] == 0.0 && reading.colour_error[1] == 0.0);
    }
}

#[test]
fn captures_of_other_sizes_turned_by_90_or_grey_are_named() {
    let size = SIZES[0];
    let whole = pattern(size);
    let larger = Size {
        width: 800,
        height: 600,
    };
    let shrunk = zoomed_to(&sent(size), size, larger);
    let found = read(&captured(&shrunk, larger), size).unwrap().faults;
    assert!(
        found.len() == 1 && found[0].starts_with("scaled: 800×600 arrive of 640×480"),
        "{found:?}"
    );
    let upright = Shot::from(&whole);
    let turned = Size {
        width: 480,
        height: 640,
    };
    let places = (0..640).flat_map(|y| (0..480).map(move |x| (y, x)));
    let bytes = places.flat_map(|(y, x)| upright.at(479 - x, y)).collect();
    let turned = Image {
        size: turned,
        bytes,
        kind: Kind::Rgb,
    };
    let found = read(&turned, size).unwrap().faults;
    assert!(found.len() == 1 && found[0].starts_with("rotated by 90°"), "{found:?}");
    let grey = pixels(|rgb| [(rgb[0] + rgb[1] + rgb[2]) / 3.0; 3]);
    assert_eq!(names(&grey(sent(size), size), size), ["no colour"]);
    // A photograph of something else.
    let other = Image {
        size,
        bytes: (0..3 * 640 * 480).map(|n| (n / 640 % 256) as u8).collect(),
        kind: Kind::Rgb,
    };
    assert_eq!(read(&other, size), None);
}

/// Enlarges a picture to another size by linear interpolation.
fn zoomed_to(picture: &[[f64; 3]], from: Size, to: Size) -> Picture {
    let at = |y: usize, x: usize| picture[y.min(from.height - 1) * from.width + x.min(from.width - 1)];
    let place = |at: usize, from: usize, to: usize| ((at as f64 + 0.5) * from as f64 / to as f64 - 0.5).max(0.0);
    let all = (0..to.height).flat_map(|y| (0..to.width).map(move |x| (y, x)));
    all.map(|(y, x)| {
        let (v, u) = (place(y, from.height, to.height), place(x, from.width, to.width));
        let row = |y: usize| mix(at(y, u as usize), at(y, u as usize + 1), u.fract());
        mix(row(v as usize), row(v as usize + 1), v.fract())
    })
    .collect()
}

#[test]
fn two_faults_are_named_together() {
    let size = SIZES[0];
    let both = |first: Link, second: Link| names(&second(first(sent(size), size), size), size);
    assert_eq!(
        both(reordered([2, 1, 0]), turned(true, true)),
        ["rotated by 180°", "BGR"]
    );
    assert_eq!(
        both(range(16.0, 235.0), filtered(0.0, 0.1)),
        ["vertical blur", "limited range"]
    );
    assert_eq!(both(zoomed(1.03, 1.03), reordered([2, 1, 0])), ["BGR", "overscan"]);
    assert_eq!(both(bits(6, true), filtered(-0.1, -0.1)), ["sharpening", "6 bits"]);
    assert_eq!(
        both(range(16.0, 235.0), bar(|y, _, _| y >= 440)),
        ["taskbar", "limited range"]
    );
    assert_eq!(both(gamma([1.2; 3]), ycbcr(2, 1)), ["tone curve", "YCbCr 4:2:2"]);
}
