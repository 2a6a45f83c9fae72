use crate::Point;

/// The point of a curve that a run returns: where `error` is least, of equal ones the last; none
/// where it is nowhere a finite number.
///
/// `error` must be one that can be seen without the answer, such as that of the hard image. A method
/// whose scale decays may pass its best step: what is returned is that step all the same.
pub fn best_step(curve: &[Point], error: impl Fn(&Point) -> f64) -> Option<&Point> {
    let finite = curve.iter().filter(|point| error(point).is_finite());
    finite.reduce(|best, point| if error(point) <= error(best) { point } else { best })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn point(step: usize, hard: f64) -> Point {
        let (loss, scale) = (0.0, 0.1);
        Point { step, loss, image_error: 0.0, parameter_error: 0.0, scale, extra: vec![hard] }
    }

    #[test]
    fn the_last_of_the_best_steps_is_returned_and_what_is_no_number_never() {
        let hard = [0.5, 0.2, f64::NAN, 0.2, 0.4];
        let curve: Vec<Point> = hard.iter().enumerate().map(|(k, &x)| point(k, x)).collect();
        let best = |curve: &[Point]| best_step(curve, |point| point.extra[0]).map(|p| p.step);
        assert_eq!(best(&curve), Some(3));
        assert_eq!(best(&curve[2..3]), None);
        assert_eq!(best(&[]), None);
    }
}
