//! Tests depth peeling on a GPU or a software driver against the CPU renderer.
use crate::driver;
use phasefront::Size;

use phasefront_io::ldi::Ldi;
use phasefront_lab::scene::{DepthPeeler, Mesh, Scene, Texture, random_scene, render_ldi_reference};
use std::sync::Arc;

fn peeler() -> DepthPeeler {
    driver::opened(DepthPeeler::new())
}

/// The depth and colour of a pixel.
type Pixel = (f32, [f32; 3]);

/// Returns the number of differing pixels in the layers: a hit in only one, depths that differ by more than 1e-4, or
/// colours that differ by more than 1/100.
fn differing(a: &Ldi, b: &Ldi) -> usize {
    let pixels = |ldi: &Ldi| {
        let of_layer = |layer: &phasefront_io::ldi::LdiLayer| {
            let pixel = |((y, x), &d): ((usize, usize), &f32)| (d, [0, 1, 2].map(|c| layer.rgb[[c, y, x]]));
            layer.depth.indexed_iter().map(pixel).collect::<Vec<_>>()
        };
        ldi.layers.iter().flat_map(of_layer).collect::<Vec<_>>()
    };
    let (a, b) = (pixels(a), pixels(b));
    assert_eq!(a.len(), b.len());
    let differ = |&((d, rgb), (e, other)): &(Pixel, Pixel)| {
        if d.is_nan() || e.is_nan() {
            return d.is_nan() != e.is_nan();
        }
        (d - e).abs() > 1e-4 || rgb.iter().zip(other).any(|(v, w)| (v - w).abs() > 0.01)
    };
    a.into_iter().zip(b).filter(differ).count()
}

/// Creates a rectangle at depth d that faces the viewer.
fn wall(x: [f32; 2], d: f32, rgb: [f32; 3]) -> Mesh {
    let corner = |i: usize, y: f32| [x[i], y, 0.5 - d];
    Mesh {
        positions: vec![corner(0, 9.0), corner(1, 9.0), corner(1, 0.0), corner(0, 0.0)],
        triangles: vec![[0, 1, 2], [0, 2, 3]],
        uv: vec![[0.5; 2]; 4],
        colour: Vec::new(),
        texture: Arc::new(Texture::plain(rgb)),
    }
}

#[test]
fn random_scenes_are_the_references_but_for_single_pixels() {
    let peeler = peeler();
    for (seed, (height, width)) in [
        (1, (96, 80)),
        (2, (61, 47)),
        (3, (7, 130)),
        (4, (128, 192)),
        (5, (192, 128)),
        (6, (1, 1)),
    ] {
        let scene = random_scene(seed, Size { width, height });
        let expected = render_ldi_reference(&scene, Size { width, height }, 5).unwrap();
        let ldi = peeler.render(&scene, Size { width, height }, 5).unwrap();
        // Each layer behind a differing pixel may differ too.
        let (count, all) = (differing(&ldi, &expected), 5 * height * width);
        assert!(
            count * 500 <= all,
            "seed {seed}: {count} of {all} differ on {}",
            peeler.adapter()
        );
    }
}

#[test]
fn simple_scenes_are_the_references_exactly() {
    let peeler = peeler();
    let same = |meshes: Vec<Mesh>| {
        let scene = Scene { meshes };
        let expected = render_ldi_reference(&scene, Size { width: 14, height: 9 }, 3).unwrap();
        assert_eq!(
            differing(
                &peeler.render(&scene, Size { width: 14, height: 9 }, 3).unwrap(),
                &expected
            ),
            0
        );
        expected
    };
    let (red, green, blue) = ([1., 0., 0.], [0., 1., 0.], [0., 0., 1.]);
    same(Vec::new());
    // Walls at the ends of the volume, outside it, and all at one depth, where the first counts.
    let ends = same(vec![
        wall([0., 9.], 1.0, red),
        wall([3., 14.], 0.0, green),
        wall([0., 14.], 1.25, blue),
    ]);
    assert_eq!(ends.layers[0].depth[[4, 1]], 1.0);
    assert_eq!(ends.layers[0].depth[[4, 12]], 0.0);
    let ties = same([red, green, blue].map(|rgb| wall([1.5, 12.5], 0.5, rgb)).to_vec());
    assert!(ties.layers[1].depth.iter().all(|d| d.is_nan()));
    // Back faces are invisible, holes are transparent, and colours are clamped to 1.
    let mut back = wall([0., 14.], 0.2, red);
    back.triangles.iter_mut().for_each(|t| t.swap(0, 1));
    let mut sieve = wall([0., 14.], 0.4, green);
    sieve.texture =
        Arc::new(Texture::new(Size { width: 2, height: 1 }, vec![[200, 200, 9, 255], [200, 200, 9, 0]]).unwrap());
    sieve.uv = vec![[0.1, 1.0], [3.1, 1.0], [3.1, 0.0], [0.1, 0.0]];
    sieve.colour = vec![[2.0, 0.5, 1.0]; 4];
    same(vec![back, sieve, wall([0., 14.], 0.9, blue)]);
}

#[test]
fn what_does_not_fit_is_refused() {
    let peeler = peeler();
    let scene = Scene {
        meshes: vec![wall([0., 9.], 0.5, [1.0; 3])],
    };
    for (height, width, layers) in [(0, 4, 1), (4, 0, 1), (4, 4, 0), (1 << 20, 4, 1), (usize::MAX, 2, 2)] {
        let message = peeler
            .render(&scene, Size { width, height }, layers)
            .unwrap_err()
            .to_string();
        assert!(!message.contains('\n'), "{message}");
    }
    let mut long = scene.clone();
    long.meshes[0].texture = Arc::new(
        Texture::new(
            Size {
                width: 1 << 20,
                height: 1,
            },
            vec![[0; 4]; 1 << 20],
        )
        .unwrap(),
    );
    assert!(
        peeler
            .render(&long, Size { width: 4, height: 4 }, 1)
            .unwrap_err()
            .to_string()
            .contains("texture of 1048576x1")
    );
    let mut broken = scene;
    broken.meshes[0].triangles[0][0] = 4;
    assert!(
        peeler
            .render(&broken, Size { width: 4, height: 4 }, 1)
            .unwrap_err()
            .to_string()
            .contains("vertex 4")
    );
}
