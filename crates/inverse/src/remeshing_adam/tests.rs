use softrast_mesh::icosphere;

use super::*;

const LONGEST: f64 = 2.0;

/// Lengths of the edges of each face, with the position of its first corner.
fn edges(mesh: &Mesh) -> Vec<([f64; 3], f64)> {
    let of_face = |face: [[f64; 3]; 3]| {
        (0..3).map(move |k| {
            let [p, q] = [face[k], face[(k + 1) % 3]];
            (p, (0..3).map(|k| (p[k] - q[k]).powi(2)).sum::<f64>().sqrt())
        })
    };
    mesh.triangles().flat_map(of_face).collect()
}

fn torus() -> Mesh {
    let of = |p: [f64; 3]| (p[0].hypot(p[1]) - 0.7).hypot(p[2]) - 0.25;
    Mesh::of_solid([[-1.0; 3], [1.0; 3]], 30, of).unwrap()
}

/// Steps against a smooth gradient that changes from step to step.
fn stirred(shape: &mut RemeshingAdam, steps: usize, colours: bool) {
    for step in 0..steps {
        let wave = |k: usize, x: f32| (3.0 * x + k as f32 + 0.1 * step as f32).sin();
        let numbers = shape.geometry().positions();
        let gradient = numbers.iter().enumerate().map(|(k, &x)| wave(k % 3, x)).collect();
        let colours = colours.then(|| vec![0.5; numbers.len()]);
        shape.step_by(gradient, colours);
    }
}

#[test]
fn a_moving_surface_stays_closed_and_of_its_genus() {
    for (mesh, euler) in [(icosphere(3), 2), (torus(), 0)] {
        let shape = RemeshingAdam::with_colours(&mesh, 0.1, [0.5; 3]).unwrap();
        let mut shape = shape.with_longest(LONGEST);
        for length in [0.1, 0.05, 0.2] {
            shape.set_length(length);
            stirred(&mut shape, 30, true);
            let mesh = shape.mesh().unwrap();
            // It refuses a surface that is open or branches.
            ClosedSurface::new(&mesh, length, 0).unwrap();
            assert_eq!(mesh.positions().len() as i64 - mesh.faces().len() as i64 / 2, euler);
            let lengths = edges(&mesh).into_iter().map(|(_, of)| of);
            let longest = lengths.clone().fold(0.0, f64::max);
            let mean = lengths.clone().sum::<f64>() / lengths.count() as f64;
            assert!(longest < 2.0 * LONGEST * length, "{longest} for {length}");
            assert!((0.8..2.0).contains(&(mean / length)), "{mean} for {length}");
            let states = shape.surface.numbers().len();
            assert_eq!(states, shape.surface.width() * mesh.positions().len());
            assert!(shape.surface.numbers().iter().all(|x| x.is_finite()));
        }
    }
}

#[test]
fn edges_are_shorter_where_the_surface_is_curved() {
    let flat = |p: &[f64; 3]| [p[0], p[1], 0.2 * p[2]];
    let ball = icosphere(4);
    let lens = ball.with_positions(ball.positions().iter().map(flat).collect()).unwrap();
    let mut shape = RemeshingAdam::new(&lens, 0.05).unwrap().with_longest(LONGEST);
    for _ in 0..30 {
        shape.step_by(vec![0.0; shape.geometry().positions().len()], None);
    }
    let mesh = shape.mesh().unwrap();
    let mean = |is_in: fn(f64) -> bool| {
        let lengths = edges(&mesh).into_iter().filter(|(p, _)| is_in(p[0].hypot(p[1])));
        let lengths: Vec<f64> = lengths.map(|(_, length)| length).collect();
        lengths.iter().sum::<f64>() / lengths.len() as f64
    };
    let (rim, middle) = (mean(|r| r > 0.97), mean(|r| r < 0.5));
    assert!(middle > 1.4 * rim, "{middle} {rim}");
}

#[test]
fn many_faces_make_edges_longer() {
    for longest in [1.0, LONGEST] {
        let shape = RemeshingAdam::new(&torus(), 0.01).unwrap().with_most_faces(2000);
        let mut shape = shape.with_longest(longest);
        stirred(&mut shape, 60, false);
        let faces = shape.faces().len();
        assert!((1000..=2000).contains(&faces), "{faces}");
    }
}
