//! The least energy of a small network, by conjugate gradients with its diagonal (Hestenes and Stiefel 1952).

/// It ends when what it still takes off is about this part of the energy.
const TOLERANCE: f64 = 1e-8;

/// What takes longer than this is no network of good elements.
const MOST_STEPS: usize = 500;

/// Weighted edges, links to 0 V, and nodes whose potential is given.
#[derive(Clone, Copy, Debug)]
pub(super) struct Network<'a> {
    pub(super) edges: &'a [([u32; 2], f64)],
    pub(super) links: &'a [f64],
    pub(super) fixed: &'a [bool],
}

impl Network<'_> {
    fn apply(&self, x: &[f64]) -> Vec<f64> {
        let mut y: Vec<f64> = x.iter().zip(self.links).map(|(x, link)| x * link).collect();
        for &([a, b], weight) in self.edges {
            let (a, b) = (a as usize, b as usize);
            let flow = weight * (x[a] - x[b]);
            y[a] += flow;
            y[b] -= flow;
        }
        y
    }

    /// One over the diagonal, 0 where nothing is to change.
    fn scale(&self) -> Vec<f64> {
        let mut diagonal = self.links.to_vec();
        for &([a, b], weight) in self.edges {
            diagonal[a as usize] += weight;
            diagonal[b as usize] += weight;
        }
        let of =
            |(diagonal, fixed): (&f64, &bool)| if *fixed || *diagonal <= 0.0 { 0.0 } else { 1.0 / diagonal };
        diagonal.iter().zip(self.fixed).map(of).collect()
    }
}

/// Minimises xᵀKx + 2 bᵀx over what is not fixed, from where x is, and returns it.
pub(super) fn relax(network: &Network<'_>, load: &[f64], x: &mut [f64]) -> f64 {
    let scale = network.scale();
    let of_start = network.apply(x);
    let energy = dot(x, &of_start).abs();
    let mut residual: Vec<f64> = of_start.iter().zip(load).map(|(y, b)| -y - b).collect();
    let scaled = |r: &[f64]| -> Vec<f64> { r.iter().zip(&scale).map(|(r, s)| r * s).collect() };
    let mut direction = scaled(&residual);
    let mut square = dot(&residual, &direction);
    for _ in 0..MOST_STEPS {
        if square <= TOLERANCE * energy {
            break;
        }
        let along = network.apply(&direction);
        let step = square / dot(&direction, &along);
        if !step.is_finite() || step <= 0.0 {
            break;
        }
        x.iter_mut().zip(&direction).for_each(|(x, p)| *x += step * p);
        residual.iter_mut().zip(&along).for_each(|(r, a)| *r -= step * a);
        let next = scaled(&residual);
        let ratio = dot(&residual, &next) / square;
        square *= ratio;
        direction.iter_mut().zip(&next).for_each(|(p, z)| *p = z + ratio * *p);
    }
    dot(x, &network.apply(x)) + 2.0 * dot(x, load)
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}
