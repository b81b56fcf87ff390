//! Section V-B.

use crate::map::Map;
use crate::minimum::minimum;
use anyhow::Context;
use capsense::Scene;
use capsense::core::geometry::Pose;
use capsense::core::glam::{DVec2, DVec3};
use capsense::series::pearson;
use clap::Args;
use std::path::{Path, PathBuf};

#[derive(Debug, Args)]
pub(crate) struct FitArguments {
    folder: PathBuf,
    #[arg(long, value_delimiter = ',')]
    radius: Vec<f64>,
    #[arg(long, value_delimiter = ',')]
    clearance: Vec<f64>,
    #[arg(long, default_value_t = 20000)]
    elements: usize,
    #[arg(long, default_value_t = 0.1)]
    length: f64,
    #[arg(long, value_delimiter = ',')]
    width: Vec<f64>,
    #[arg(long, value_delimiter = ',')]
    gap: Vec<f64>,
}

struct Measured {
    samples: Vec<f64>,
    values: Vec<f64>,
}

fn read(path: &Path) -> anyhow::Result<Measured> {
    let mut m = Measured { samples: vec![], values: vec![] };
    for r in csv::Reader::from_path(path).with_context(|| path.display().to_string())?.records() {
        let r = r?;
        m.samples.push(r[0].parse()?);
        m.values.push(r[1].parse()?);
    }
    Ok(m)
}

/// Place after a length along a polyline that repeats itself.
fn along(points: &[DVec2], length: f64, closed: bool) -> DVec2 {
    let n = points.len();
    let legs = if closed { n } else { n - 1 };
    let lens: Vec<f64> = (0..legs).map(|k| points[k].distance(points[(k + 1) % n])).collect();
    let total: f64 = lens.iter().sum();
    let mut s = if length <= 0.0 {
        0.0
    } else if closed {
        length % total
    } else {
        length.min(total)
    };
    for k in 0..legs {
        if s <= lens[k] || k + 1 == legs {
            return points[k].lerp(points[(k + 1) % n], if lens[k] > 0.0 { s / lens[k] } else { 0.0 });
        }
        s -= lens[k];
    }
    points[0]
}

fn score(map: &Map, entry: usize, m: &Measured, path: impl Fn(f64) -> DVec2) -> f64 {
    let sim: Vec<f64> = m.samples.iter().map(|&s| map.at(entry, path(s))).collect();
    pearson(&m.values, &sim.iter().map(|c| -c).collect::<Vec<_>>()).unwrap_or(0.0)
}

fn scene_text(a: &FitArguments, w: f64, g: f64, radius: f64) -> String {
    let stripe = |n: usize| {
        format!(
            "[[sensor.electrode]]\nname = \"E{n}\"\nrectangle = {{ center = [0.0, {}], size = [{}, {w}] }}\n",
            (n as f64 - 2.0) * (w + g),
            a.length
        )
    };
    format!(
        "domain = {{ min = [-0.3, -0.3, -0.05], max = [0.3, 0.3, 0.35] }}\nmesh.generate = {{ elements = {} }}\n{}{}{}[[object]]\nname = \"rod\"\ncylinder = {{ radius = {radius}, length = 0.15 }}\nmaterial = {{ conductor = \"grounded\" }}\nposition = [0.0, 0.0, 0.2]\n[simulation]\ngeometry = \"solids\"\n[solver]\ntolerance = 1e-4",
        a.elements,
        stripe(1),
        stripe(2),
        stripe(3)
    )
}

pub(crate) fn fit(arguments: &FitArguments) -> anyhow::Result<()> {
    let tri = read(&arguments.folder.join("fig9_stripe_triangular_measured.csv"))?;
    let zig = read(&arguments.folder.join("fig9_stripe_zigzag_measured.csv"))?;
    for &radius in &arguments.radius {
        for &clearance in &arguments.clearance {
            for &w in &arguments.width {
                for &g in &arguments.gap {
                    let scene = Scene::parse("fit", &scene_text(arguments, w, g, radius), Path::new("."))?;
                    let reach = DVec2::new(0.14, 0.2);
                    let flat = Map::new(&scene, (-reach, reach), DVec2::new(0.01, 0.005), |p| {
                        Pose::at(DVec3::new(p.x, p.y, clearance + 0.075))
                    })?;
                    let zs = (0.004f64.ln(), 0.14f64.ln());
                    for (a, b) in [(0, 1), (0, 2)] {
                        let entry = flat.entry(a, b);
                        let yc = if b == 1 { -0.5 * (w + g) } else { 0.0 };
                        let upright = Map::new(
                            &scene,
                            (DVec2::new(-0.17, zs.0), DVec2::new(0.17, zs.1)),
                            DVec2::new(0.0085, (zs.1 - zs.0) / 16.0),
                            |p| Pose::at(DVec3::new(p.x, yc, p.y.exp() + 0.075)),
                        )?;
                        let zigzag = |p: &[f64]| {
                            if p[2] > 0.04 {
                                return 0.0;
                            }
                            score(&flat, entry, &zig, |s| {
                                let u = ((s - p[1]) / 48.1).clamp(0.0, 10.0);
                                let k = u.floor();
                                let f = 2.0 * (u - k) - 1.0;
                                let sweep =
                                    p[4] + 0.5 * p[0] * 48.1 * f * if k as i64 % 2 == 0 { 1.0 } else { -1.0 };
                                DVec2::new(p[3] + p[2] * (u - 5.0), yc + sweep)
                            })
                        };
                        // step, t0, left, right, apex x, apex height
                        let triangle = |p: &[f64]| {
                            let low = clearance;
                            if p[5] < 0.0 || p[5] > 0.3 {
                                return 0.0;
                            }
                            let points =
                                [DVec2::new(p[2], low), DVec2::new(p[4], low + p[5]), DVec2::new(p[3], low)];
                            score(&upright, entry, &tri, |s| {
                                let at = along(&points, p[0] * (s - p[1]), true);
                                DVec2::new(at.x, at.y.max(0.004).ln())
                            })
                        };
                        let show =
                            |p: &[f64]| p.iter().map(|x| format!("{x:.4}")).collect::<Vec<_>>().join(" ");
                        let z = [0.003, 0.004, 0.0055, 0.007]
                            .map(|step| {
                                minimum(
                                    &[step, 3.0, 0.018, 0.0, 0.0],
                                    &[0.0005, 0.5, 0.002, 0.003, 0.003],
                                    |p| 1.0 - zigzag(p),
                                )
                            })
                            .into_iter()
                            .min_by(|a, b| a.1.total_cmp(&b.1))
                            .context("none")?;
                        let mut best = (vec![], 9.0);
                        for step in [0.003, 0.004, 0.0055] {
                            for sign in [1.0, -1.0] {
                                for h in [0.3, 0.6, 1.0] {
                                    let t = minimum(
                                        &[
                                            step,
                                            25.0,
                                            -22.0 * step * sign,
                                            22.0 * step * sign,
                                            0.0,
                                            26.0 * step * h,
                                        ],
                                        &[0.0003, 3.0, 0.01, 0.01, 0.01, 0.01],
                                        |p| 1.0 - triangle(p),
                                    );
                                    if t.1 < best.1 {
                                        best = t;
                                    }
                                }
                            }
                        }
                        let join = |p: &[f64]| {
                            let mut t = vec![p[0]];
                            t.extend(&p[5..]);
                            2.0 - zigzag(&p[..5]) - triangle(&t)
                        };
                        let mut start = z.0.clone();
                        start[0] = 0.5 * (start[0] + best.0[0]);
                        start.extend(&best.0[1..]);
                        let j = minimum(
                            &start,
                            &[0.0003, 0.5, 0.002, 0.003, 0.003, 3.0, 0.01, 0.01, 0.01, 0.01],
                            join,
                        );
                        let mut t = vec![j.0[0]];
                        t.extend(&j.0[5..]);
                        println!(
                            "r {radius} h {clearance} w {w} g {g} C{}{}: zig {:.4} [{}]  tri {:.4} [{}]  both {:.4} {:.4} [{}]",
                            a + 1,
                            b + 1,
                            1.0 - z.1,
                            show(&z.0),
                            1.0 - best.1,
                            show(&best.0),
                            zigzag(&j.0[..5]),
                            triangle(&t),
                            show(&j.0)
                        );
                    }
                }
            }
        }
    }
    Ok(())
}
