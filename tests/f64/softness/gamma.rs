//! Gamma compared with the incomplete gamma function with 250 digits, and at its edge.

use softrast_softness::{Family, Softness};

use super::{RELATIVE, assert_relative, numbers, vector};

#[test]
fn gamma_matches_the_incomplete_gamma_function() {
    for (shape, y, below, above) in INCOMPLETE_GAMMA {
        let phi = vector(&[0.0, shape.ln(), 0.0]);
        let what = format!("shape {shape} at {y}");
        let forward = numbers(Family::GammaForward.value(phi.clone(), vector(&[y])))[0];
        let reversed = numbers(Family::Gamma.value(phi.clone(), vector(&[-y])))[0];
        let depth = numbers(Family::GammaForward.optical_depth(phi, vector(&[y])))[0];
        assert_relative(forward, below, RELATIVE, &what);
        assert_relative(reversed, above, RELATIVE, &what);
        let expected = if below < 0.5 { -(-below).ln_1p() } else { -above.ln() };
        assert_relative(depth, expected, RELATIVE, &what);
    }
}

#[test]
fn gamma_of_shape_one_is_exp() {
    let x = [-7.0, -1.3, -0.2, 0.4];
    let gamma = numbers(Family::Gamma.value(vector(&[-1.0, 0.0, 0.3]), vector(&x)));
    let exp = numbers(Family::Exp.value(vector(&[-1.0, 0.3]), vector(&x)));
    gamma.iter().zip(exp).for_each(|(g, e)| assert_relative(*g, e, 1e-14, "gamma"));
}

#[test]
fn gamma_density_stops_growing_at_the_edge() {
    let phi = vector(&[0.0, 0.5_f64.ln(), 0.0]);
    let density =
        numbers(Family::Gamma.density(phi, vector(&[-1e-8, -0.99e-8, -1e-300, 0.0, 1e-9])));
    // 1 / sqrt(π y) at the floor; from there to the edge a straight line to (2 - p) erf(1e-4) / 1e-8, without a jump.
    assert_relative(density[0], 1.0 / (std::f64::consts::PI * 1e-8).sqrt(), 2e-8, "at the floor");
    for (density, part) in density[1..4].iter().zip([0.99, 0.0, 0.0]) {
        assert_relative(*density, 1.128_379_163e4 * (1.5 - part), 1e-9, "on the line");
    }
    assert_eq!(density[4], 0.0);
}

/// Shape p, distance y, P(p, y), Q(p, y); computed with mpmath.
#[rustfmt::skip]
const INCOMPLETE_GAMMA: [(f64, f64, f64, f64); 36] = [
    (0.1, 0.001, 0.5267685683924451, 0.4732314316075549),
    (0.1, 0.25, 0.8955592438575556, 0.10444075614244439),
    (0.1, 1.0, 0.9758726562736723, 0.024127343726327778),
    (0.1, 4.0, 0.9995353887127678, 0.0004646112872322253),
    (0.1, 9.0, 0.9999983548303903, 1.6451696097003875e-06),
    (0.1, 30.0, 0.9999999999999996, 4.476766580012692e-16),
    (0.5, 0.001, 0.03567059172967989, 0.9643294082703201),
    (0.5, 0.25, 0.5204998778130465, 0.4795001221869535),
    (0.5, 1.0, 0.8427007929497149, 0.15729920705028513),
    (0.5, 4.0, 0.9953222650189527, 0.004677734981047266),
    (0.5, 9.0, 0.9999779095030014, 2.209049699858544e-05),
    (0.5, 30.0, 0.9999999999999906, 9.485737571073848e-15),
    (1.0, 0.001, 0.0009995001666250085, 0.999000499833375),
    (1.0, 0.25, 0.22119921692859512, 0.7788007830714049),
    (1.0, 1.0, 0.6321205588285577, 0.36787944117144233),
    (1.0, 4.0, 0.9816843611112658, 0.01831563888873418),
    (1.0, 9.0, 0.9998765901959134, 0.00012340980408667956),
    (1.0, 30.0, 0.9999999999999064, 9.357622968840175e-14),
    (2.0, 0.001, 4.996667916333403e-07, 0.9999995003332084),
    (2.0, 0.25, 0.026499021160743916, 0.9735009788392561),
    (2.0, 1.0, 0.26424111765711533, 0.7357588823428847),
    (2.0, 4.0, 0.9084218055563291, 0.09157819444367091),
    (2.0, 9.0, 0.9987659019591332, 0.0012340980408667955),
    (2.0, 30.0, 0.9999999999970991, 2.900863120340454e-12),
    (5.0, 0.001, 8.326391864211503e-18, 1.0),
    (5.0, 0.25, 6.611710561034247e-06, 0.999993388289439),
    (5.0, 1.0, 0.0036598468273437122, 0.9963401531726563),
    (5.0, 4.0, 0.37116306482012645, 0.6288369351798735),
    (5.0, 9.0, 0.9450363585048951, 0.0549636414951049),
    (5.0, 30.0, 0.999999996375699, 3.6243009520614882e-09),
    (15.0, 0.001, 7.639997888508088e-58, 1.0),
    (15.0, 0.25, 5.634558720450991e-22, 1.0),
    (15.0, 1.0, 3.0000106665252023e-13, 0.9999999999997),
    (15.0, 4.0, 1.9931727482710028e-05, 0.9999800682725173),
    (15.0, 9.0, 0.04146632547290372, 0.9585336745270963),
    (15.0, 30.0, 0.9990793176038514, 0.0009206823961486663),
];
