//! Section V-B.

use crate::map::Map;
use crate::minimum::minimum;
use anyhow::Context;
use capsense::Scene;
use capsense::core::geometry::Shape;
use capsense::core::glam::DVec2;
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
    #[arg(long, default_value_t = 60)]
    starts: usize,
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

pub(crate) fn fit(arguments: &FitArguments) -> anyhow::Result<()> {
    let tri = read(&arguments.folder.join("fig9_stripe_triangular_measured.csv"))?;
    let zig = read(&arguments.folder.join("fig9_stripe_zigzag_measured.csv"))?;
    for &radius in &arguments.radius {
        for &clearance in &arguments.clearance {
            let text = format!(
                r#"
mesh.generate = {{ elements = {} }}
[[sensor.electrode]]
name = "E1"
rectangle = {{ center = [0.0, -0.03], size = [0.1, 0.02] }}
[[sensor.electrode]]
name = "E2"
rectangle = {{ center = [0.0, 0.0], size = [0.1, 0.02] }}
[[sensor.electrode]]
name = "E3"
rectangle = {{ center = [0.0, 0.03], size = [0.1, 0.02] }}
[[object]]
name = "rod"
cylinder = {{ radius = {radius}, length = 0.15 }}
material = {{ conductor = "grounded" }}
position = [0.0, 0.0, 0.2]
[simulation]
geometry = "solids"
"#,
                arguments.elements
            );
            let scene = Scene::parse("fit", &text, Path::new("."))?;
            let shape = Shape::Cylinder { radius, length: 0.15 };
            let reach = DVec2::new(0.16, 0.16);
            let now = std::time::Instant::now();
            let map = Map::new(&scene, &shape, clearance + 0.075, (-reach, reach), 0.008)?;
            println!("r {radius} h {clearance}: map {:.1} s", now.elapsed().as_secs_f64());
            for (a, b) in [(0, 1), (0, 2)] {
                let entry = map.entry(a, b);
                let yc = if b == 1 { -0.015 } else { 0.0 };
                let mut rng = 1u64;
                let mut random = move |low: f64, high: f64| { rng = rng.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407); low + (high - low) * ((rng >> 33) as f64 / 2f64.powi(31)) };
                let mut bestz = (vec![], 9.0);
                for across in [0.0, 1.0] {
                for w in [0.03, 0.05, 0.08, 0.11, 0.15] {
                    for pitch in [0.006, 0.012, 0.018, 0.025, 0.032] {
                    // samples a pass, first sample, half width, pitch, centre along, centre across
                    let start = [48.1, 3.0, w, pitch, 0.0, 0.0];
                    let steps = [0.1, 0.5, 0.01, 0.003, 0.005, 0.005];
                    let z = minimum(&start, &steps, |p| {
                        if p[2] > 0.16 || p[3] > 0.04 { return 2.0; }
                        1.0 - score(&map, entry, &zig, |s| {
                            let u = ((s - p[1]) / p[0]).clamp(0.0, 10.0);
                            let k = u.floor();
                            let f = 2.0 * (u - k) - 1.0;
                            let sweep = p[4] + p[2] * f * if k as i64 % 2 == 0 { 1.0 } else { -1.0 };
                            let lateral = p[5] + p[3] * (u - 5.0);
                            if across == 0.0 { DVec2::new(lateral, yc + sweep) } else { DVec2::new(sweep, yc + lateral) }
                        })
                    });
                    if z.1 < bestz.1 { bestz = z; bestz.0.push(across); }
                    }
                }
                }
                let show = |p: &[f64]| p.iter().map(|x| format!("{x:.4}")).collect::<Vec<_>>().join(" ");
                println!("  C{}{}: zig {:.4} [{}]", a + 1, b + 1, 1.0 - bestz.1, show(&bestz.0));
                let mut found: Vec<(Vec<f64>, f64)> = vec![];
                for _ in 0..arguments.starts {
                    let mut start = vec![random(95.0, 98.0), random(0.0, 96.0)];
                    let scale = random(0.02, 0.12);
                    for _ in 0..3 { start.push(random(-scale, scale)); start.push(yc + random(-scale, scale)); }
                    let steps = [0.3, 4.0, 0.02, 0.02, 0.02, 0.02, 0.02, 0.02];
                    let t = minimum(&start, &steps, |p| {
                        if p[2..].iter().any(|x| x.abs() > 0.18) { return 2.0; }
                        let points = [DVec2::new(p[2], p[3]), DVec2::new(p[4], p[5]), DVec2::new(p[6], p[7])];
                        let total: f64 = (0..3).map(|k| points[k].distance(points[(k + 1) % 3])).sum();
                        1.0 - score(&map, entry, &tri, |s| along(&points, (total * (s - p[1] + 2.0 * p[0]) / p[0]).max(0.0), true))
                    });
                    found.push(t);
                }
                found.sort_by(|a, b| a.1.total_cmp(&b.1));
                for t in found.iter().take(4) {
                    let q = &t.0; let d = |a: usize, b: usize| DVec2::new(q[a], q[a+1]).distance(DVec2::new(q[b], q[b+1]));
                    println!("     tri {:.4} step {:.5} [{}]", 1.0 - t.1, (d(2,4) + d(4,6) + d(6,2)) / q[0], show(&t.0));
                }
            }
        }
    }
    Ok(())
}
