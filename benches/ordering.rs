#![allow(clippy::unwrap_used, missing_docs)]
mod common;
use capsense_core::glam::DVec3;
use capsense_core::material::{Connection, Material};
use capsense_core::mesh::{Bisection, Lattice, TetMesh};
use capsense_core::sensor::{ElectrodeNodes, Sensor};
use capsense_core::simulator::Simulator;
use capsense_core::units::LengthUnit;
use common::{DOMAIN, Motion, design, solver_options};
use std::time::Instant;

fn sensor(mesh: TetMesh) -> Sensor {
    let bounds = mesh.bounds();
    let ground: Vec<u32> = (0..mesh.nodes().len() as u32)
        .filter(|&n| {
            let p = mesh.nodes()[n as usize];
            (p - bounds.min).min_element() < 1e-9 || (bounds.max - p).min_element() < 1e-9
        })
        .collect();
    let electrodes =
        design().electrodes.into_iter().map(|e| (e.name.clone(), ElectrodeNodes::Shape(e))).collect();
    Sensor::on_mesh(mesh, &ground, electrodes).unwrap()
}

fn hash(mut x: u64) -> u64 {
    x = (x ^ (x >> 30)).wrapping_mul(0xbf58476d1ce4e5b9);
    x = (x ^ (x >> 27)).wrapping_mul(0x94d049bb133111eb);
    x ^ (x >> 31)
}
fn by<K: Ord>(mesh: &TetMesh, key: impl Fn(usize, DVec3) -> K) -> Vec<u32> {
    let mut order: Vec<u32> = (0..mesh.nodes().len() as u32).collect();
    order.sort_by_cached_key(|&n| (key(n as usize, mesh.nodes()[n as usize]), n));
    order
}
fn grid(mesh: &TetMesh, p: DVec3) -> [u32; 3] {
    let b = mesh.bounds();
    ((p - b.min) / b.size().max_element() * 1_048_575.0).to_array().map(|v| v as u32)
}
fn spread(v: u32) -> u64 {
    (0..20).fold(0, |s, bit| s | ((u64::from(v) >> bit & 1) << (3 * bit)))
}
fn morton(c: [u32; 3]) -> u64 {
    spread(c[0]) | spread(c[1]) << 1 | spread(c[2]) << 2
}
/// Skilling 2004.
fn hilbert(mut x: [u32; 3]) -> u64 {
    let m = 1u32 << 19;
    let mut q = m;
    while q > 1 {
        let p = q - 1;
        for i in 0..3 {
            if x[i] & q != 0 {
                x[0] ^= p;
            } else {
                let t = (x[0] ^ x[i]) & p;
                x[0] ^= t;
                x[i] ^= t;
            }
        }
        q >>= 1;
    }
    x[1] ^= x[0];
    x[2] ^= x[1];
    let mut t = 0;
    let mut q = m;
    while q > 1 {
        if x[2] & q != 0 {
            t ^= q - 1;
        }
        q >>= 1;
    }
    for v in &mut x {
        *v ^= t;
    }
    spread(x[2]) | spread(x[1]) << 1 | spread(x[0]) << 2
}
fn rcm(mesh: &TetMesh) -> Vec<u32> {
    let n = mesh.nodes().len();
    let mut at = vec![Vec::new(); n];
    for t in mesh.tets() {
        for &a in t {
            for &b in t {
                if a != b {
                    at[a as usize].push(b);
                }
            }
        }
    }
    for l in &mut at {
        l.sort_unstable();
        l.dedup();
    }
    let mut from = 0u32;
    let mut order = Vec::new();
    for _ in 0..2 {
        let mut seen = vec![false; n];
        order.clear();
        order.push(from);
        seen[from as usize] = true;
        let mut next = 0;
        while next < order.len() {
            let mut l: Vec<u32> = at[order[next] as usize].clone();
            next += 1;
            l.retain(|&o| !std::mem::replace(&mut seen[o as usize], true));
            l.sort_by_key(|&o| (at[o as usize].len(), o));
            order.extend(l);
        }
        from = *order.last().unwrap();
    }
    assert_eq!(order.len(), n);
    order.reverse();
    order
}

fn cpu() -> f64 {
    let stat = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    stat.split_whitespace().next().unwrap().parse::<f64>().unwrap() * 1e-6
}

fn main() {
    let args: Vec<String> = std::env::args().skip(1).filter(|a| !a.starts_with("--")).collect();
    let mesh = match args[0].parse::<usize>() {
        Ok(size) => {
            let lattice = design().lattice(size / 8).unwrap();
            let mut b = Bisection::new(&lattice).unwrap();
            let near = |p: DVec3| 0.0005 + 0.02 * (p.z.abs() + (p.x.abs() - 0.05).max(0.0) + (p.y.abs() - 0.04).max(0.0));
            let near = |p: DVec3| near(p) * args.get(2).map_or(1.0, |f| f.parse().unwrap());
            b.refine_to_size(near, size);
            b.into_tet_mesh().unwrap()
        }
        Err(_) => capsense::gmsh::parse(&std::fs::read(&args[0]).unwrap())
            .unwrap()
            .to_tet_mesh(LengthUnit::Metre)
            .unwrap(),
    };
    let _ = (DOMAIN, Lattice::new);
    println!("{} tets {} nodes", mesh.tets().len(), mesh.nodes().len());
    let wanted: Vec<&str> = args[1].split(',').collect();
    let made: Vec<(&str, Box<dyn Fn() -> Vec<u32>>)> = vec![
        ("file", Box::new(|| (0..mesh.nodes().len() as u32).collect())),
        ("random", Box::new(|| by(&mesh, |n, _| hash(n as u64 + 1)))),
        ("z", Box::new(|| by(&mesh, |_, p| { let g = grid(&mesh, p); [g[2], g[1], g[0]] }))),
        ("x", Box::new(|| by(&mesh, |_, p| grid(&mesh, p)))),
        ("morton", Box::new(|| by(&mesh, |_, p| morton(grid(&mesh, p))))),
        ("hilbert", Box::new(|| by(&mesh, |_, p| hilbert(grid(&mesh, p))))),
        ("rcm", Box::new(|| rcm(&mesh))),
    ];
    let mut sims = Vec::new();
    for (name, order) in made.iter().filter(|m| wanted.contains(&m.0)) {
        let t = Instant::now();
        let order = order();
        let ordering = t.elapsed().as_secs_f64();
        let renumbered = mesh.renumbered(&order);
        let t = Instant::now();
        let sim = Simulator::new(
            sensor(renumbered),
            vec![Material::Conductor(Connection::Grounded)],
            solver_options(Some(1)),
        )
        .unwrap();
        println!("{name}: order {ordering:.3} s, build {:.3} s", t.elapsed().as_secs_f64());
        sims.push((*name, sim));
    }
    let ways = 2;
    for mut motion in Motion::all() {
        let mut times = vec![[0.0f64; 2]; sims.len()];
        let frames = 40.min(motion.len());
        let images: Vec<_> = (0..frames).map(|_| { for _ in 0..4 { motion.next(); } motion.next().clone() }).collect();
        for way in 0..=ways {
            for (k, (_, sim)) in sims.iter_mut().enumerate() {
                for depth in &images {
                    let a = cpu();
                    sim.update(depth).unwrap();
                    let b = cpu();
                    let _ = sim.solve().unwrap();
                    let c = cpu();
                    if way > 0 {
                        times[k][0] += b - a;
                        times[k][1] += c - b;
                    }
                }
            }
        }
        let n = (ways * frames) as f64;
        for (k, (name, sim)) in sims.iter().enumerate() {
            let [u, s] = times[k].map(|t| t / n);
            println!("{:<9} {name:<8} update {u:.3} solve {s:.3} step {:.3} ms  x{:.3}  C11 {:.6e}", motion.name, u + s, (times[0][0] + times[0][1]) / (times[k][0] + times[k][1]), sim.capacitance().get(0, 0));
        }
    }
}
