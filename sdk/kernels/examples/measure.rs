use phasefront_kernels::*;

fn main() {
    let a: Vec<String> = std::env::args().collect();
    let (layers, h, w, th, reps): (usize, usize, usize, usize, usize) = (
        a[1].parse().unwrap(),
        a[2].parse().unwrap(),
        a[3].parse().unwrap(),
        a[4].parse().unwrap(),
        a[5].parse().unwrap(),
    );
    let strip: usize = a.get(6).map_or(0, |s| s.parse().unwrap());
    let filt: String = a.get(7).cloned().unwrap_or_default();
    let mut s = 1u64;
    let mut rnd = || {
        s = s
            .wrapping_mul(6364136223846793005)
            .wrapping_add(1442695040888963407);
        (s >> 33) as u32
    };
    let f = 24;
    let mut i8l = vec![];
    let mut f32l = vec![];
    let mut mac = 0;
    for i in 0..layers {
        let last = i + 1 == layers;
        let inputs = if i == 0 {
            4
        } else if last {
            f + 4
        } else {
            f
        };
        let outputs = if last { 6 } else { f };
        mac += 9 * inputs * outputs;
        let skip = !last && i + 1 >= 3 && (i + 1) % 2 == 1;
        i8l.push(Int8Layer {
            inputs,
            outputs,
            zero_point: if i == 0 {
                127
            } else if last {
                17
            } else {
                0
            },
            kernel: (0..inputs * outputs * 9)
                .map(|_| (rnd() % 255) as u8 as i8)
                .collect(),
            bias: vec![100; outputs],
            multiplier: vec![1e-3; outputs],
            requantise: Requantise {
                skip: skip.then_some(SkipSum {
                    relu: Some(0.7),
                    skip: 0.6,
                }),
                rescale: (i + 2 == layers).then_some(0.8),
            },
        });
        f32l.push(F32Layer {
            inputs,
            outputs,
            kernel: (0..inputs * outputs * 9)
                .map(|_| (rnd() % 255) as f32 / 2550. - 0.05)
                .collect(),
            bias: vec![0.1; outputs],
        });
    }
    let input: Vec<f32> = (0..4 * h * w)
        .map(|_| (rnd() % 255) as f32 / 255. - 0.5)
        .collect();
    let mut out = vec![0f32; 6 * h * w];
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(th)
        .build()
        .unwrap();
    let report = |name: String, ts: &mut Vec<f64>, bytes: usize, t: Tiling| {
        ts.remove(0);
        ts.sort_by(|a, b| a.total_cmp(b));
        println!(
            "{name:14} L={layers} {w}x{h} th={th} median {:.1} min {:.1} ms  {:.0} GMAC/s work {:.2} MB {t:?}",
            ts[ts.len() / 2],
            ts[0],
            mac as f64 * (h * w) as f64 / ts[0] / 1e6,
            bytes as f64 / 1e6
        )
    };
    pool.install(|| {
        for isa in Isa::int8() {
            if isa == Isa::Portable || !format!("i8{isa}").contains(&filt) {
                continue;
            }
            let c = Int8Chain::new(
                &i8l,
                Quantiser {
                    scale: 1. / 254.,
                    zero_point: 127,
                },
                Quantiser {
                    scale: 0.01,
                    zero_point: 17,
                },
                true,
                isa,
            )
            .unwrap();
            let sc = Scratch::default();
            let mut t = c.tiling(h, w);
            if strip > 0 {
                t.strip_columns = strip;
            }
            let mut ts = vec![];
            for _ in 0..=reps {
                let t0 = std::time::Instant::now();
                c.run(&input, &mut out, (h, w), t, &sc);
                ts.push(t0.elapsed().as_secs_f64() * 1e3);
            }
            report(format!("int8 {isa}"), &mut ts, sc.bytes(), t);
        }
        for isa in Isa::f32() {
            if isa == Isa::Portable || !format!("f32{isa}").contains(&filt) {
                continue;
            }
            let c = F32Chain::new(&f32l, isa).unwrap();
            let sc = Scratch::default();
            let mut t = c.tiling(h, w);
            if strip > 0 {
                t.strip_columns = strip;
            }
            let mut ts = vec![];
            for _ in 0..=reps {
                let t0 = std::time::Instant::now();
                c.run(&input, &mut out, (h, w), t, &sc);
                ts.push(t0.elapsed().as_secs_f64() * 1e3);
            }
            report(format!("f32 {isa}"), &mut ts, sc.bytes(), t);
        }
    });
}
