use super::*;
use std::time::Instant;

fn table(grid: &Grid, tau: f64) -> Vec<f64> {
    let knots = grid.knots();
    let mut out = vec![];
    for side in [-1.0, 1.0] {
        let r2 = if side < 0.0 { grid.outer.powi(2) } else { grid.inner.powi(2) };
        let q = |y: f64| {
            let u = side * y * r2 / tau;
            u.max(0.0) + (-u.abs()).exp().ln_1p()
        };
        let dq = |y: f64| {
            let u = side * y * r2 / tau;
            side * r2 / tau / (1.0 + (-u).exp())
        };
        for k in 0..grid.cells() {
            let (a, b) = (knots[k], knots[k + 1]);
            let h = b - a;
            let (va, vb) = (q(a), q(b));
            if k == 0 {
                out.extend([va, vb - va, 0.0, 0.0]);
                continue;
            }
            let (ma, mb) = (h * dq(a), h * dq(b));
            out.extend([va, ma, 3.0 * (vb - va) - 2.0 * ma - mb, 2.0 * (va - vb) + ma + mb]);
        }
        out.extend([q(1.0), 0.0, 0.0, 0.0]);
    }
    out
}

fn load(path: &str) -> (Vec<[f64; 3]>, Vec<[u32; 3]>) {
    let (mut v, mut f) = (vec![], vec![]);
    for line in std::fs::read_to_string(path).unwrap().lines() {
        let mut w = line.split_whitespace();
        match w.next() {
            Some("v") => {
                let p: Vec<f64> = w.map(|x| x.parse().unwrap()).collect();
                v.push([p[0], p[1], p[2]]);
            }
            Some("f") => {
                let p: Vec<u32> =
                    w.map(|x| x.split('/').next().unwrap().parse::<u32>().unwrap() - 1).collect();
                for i in 1..p.len() - 1 {
                    f.push([p[0], p[i], p[i + 1]]);
                }
            }
            _ => {}
        }
    }
    (v, f)
}

fn run<F: Float>(name: &str, mesh: &str, azimuths: &[f64], size: usize) {
    let (v, faces) = load(&format!("../../../shared/data/meshes/paper/{mesh}"));
    let mut vertices: Vec<F> = vec![];
    for az in azimuths {
        let (s, c) = az.to_radians().sin_cos();
        let d = 2.732;
        let eye = [d * s, 0.0, -d * c];
        let z = [-s, 0.0, c];
        let x = [c, 0.0, s];
        let tan = 30f64.to_radians().tan();
        for p in &v {
            let q = [p[0] - eye[0], p[1] - eye[1], p[2] - eye[2]];
            let tz = q[0] * z[0] + q[2] * z[2];
            let tx = q[0] * x[0] + q[2] * x[2];
            vertices.extend([tx / (tz * tan), q[1] / (tz * tan), tz].map(F::from_f64));
        }
    }
    let tau = 1e-4f64;
    let radius = (tau * (faces.len() as f64 / 1e-5).ln()).sqrt();
    let grid = Grid { outer: radius, inner: radius * 1.0, octaves: 40, bits: 4 };
    let table: Vec<F> = table(&grid, tau).into_iter().map(F::from_f64).collect();
    let inputs = Inputs {
        vertices: &vertices,
        table: &table,
        faces: &faces,
        grid,
        size,
        near: 1e-3,
        views: azimuths.len(),
    };
    let mut target = vec![];
    for _ in azimuths {
        for r in 0..size {
            for c in 0..size {
                let x = (2.0 * c as f64 + 1.0 - size as f64) / size as f64 + 0.1;
                let y = (2.0 * (size - 1 - r) as f64 + 1.0 - size as f64) / size as f64 - 0.05;
                target.push(if x * x + y * y <= 0.25 { 1.0 } else { 0.0 });
            }
        }
    }
    let n = target.len() as f64;
    let (mut f, mut b, mut h) = (vec![], vec![], vec![]);
    let mut out = (0.0, 0.0, 0.0);
    for _ in 0..15 {
        let t = Instant::now();
        let s = forward(&inputs);
        f.push(t.elapsed().as_secs_f64() * 1e3);
        let alpha: Vec<f64> = s.iter().map(|s| 1.0 - (-s.to_f64()).exp()).collect();
        let loss = alpha.iter().zip(&target).map(|(a, t)| (a - t) * (a - t)).sum::<f64>() / n;
        let g: Vec<F> = alpha
            .iter()
            .zip(&target)
            .map(|(a, t)| F::from_f64(2.0 * (a - t) * (1.0 - a) / n))
            .collect();
        let t = Instant::now();
        let grad = vjp(&inputs, &g, false);
        b.push(t.elapsed().as_secs_f64() * 1e3);
        let mut sum = vec![0.0; v.len() * 3];
        for view in 0..azimuths.len() {
            let (s, c) = azimuths[view].to_radians().sin_cos();
            let tan = 30f64.to_radians().tan();
            for i in 0..v.len() {
                let at = 3 * (view * v.len() + i);
                let (gx, gy) = (grad[at].to_f64(), grad[at + 1].to_f64());
                let (x, y, z) =
                    (vertices[at].to_f64(), vertices[at + 1].to_f64(), vertices[at + 2].to_f64());
                let (tx, ty, tz) = (gx / (z * tan), gy / (z * tan), -(gx * x + gy * y) / z);
                sum[3 * i] += tx * c - tz * s;
                sum[3 * i + 1] += ty;
                sum[3 * i + 2] += tx * s + tz * c;
            }
        }
        out = (loss, alpha.iter().sum::<f64>() / n, sum.iter().map(|g| g * g).sum::<f64>().sqrt());
        let u = vec![F::from_f64(0.01); grad.len()];
        let t = Instant::now();
        let _ = vjp_of_vjp(&inputs, &g, &u);
        h.push(t.elapsed().as_secs_f64() * 1e3);
    }
    for x in [&mut f, &mut b, &mut h] {
        x.sort_by(f64::total_cmp);
    }
    println!(
        "{name} loss {:.7} alpha {:.7} grad {:.7}  fwd {:.2} vjp {:.2} hvp {:.2} ms",
        out.0, out.1, out.2, f[0], b[0], h[0]
    );
}

#[test]
fn probe() {
    let az: Vec<f64> = (0..24).map(|i| 15.0 * f64::from(i)).collect();
    run::<f32>("W1 f32", "sphere_642.obj", &az, 64);
    run::<f32>("W2 f32", "spot.obj", &[180.0], 256);
    if std::env::var("F64").is_ok() {
    } else {
        return;
    }
    run::<f64>("W1 f64", "sphere_642.obj", &az, 64);
    if std::env::var("F64").is_ok() {
    } else {
        return;
    }
    run::<f64>("W2 f64", "spot.obj", &[180.0], 256);
}
