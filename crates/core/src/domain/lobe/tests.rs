//! Properties of lobes: values, densities, what is drawn, light and means.

use super::{CENTRES, Lobe, LobeCentre, LobeParameters};
use crate::domain::{Direction, Domain, TriangleMesh};

/// Returns a reflection lobe about `centre` with a full width at half maximum of `width` degrees in outgoing
/// directions.
fn lobe(centre: LobeCentre, width: f64, tail: f64) -> Lobe {
    let half = width.to_radians() * if centre == LobeCentre::HalfVector { 0.25 } else { 0.5 };
    Lobe::new(LobeParameters {
        centre,
        peak: [3.0, 0.4, 0.1],
        range: [0.0, 1.2],
        widths: [half, half],
        angle: 0.0,
        tail,
        colours: vec![1.0],
    })
    .unwrap()
}

fn anisotropic() -> Lobe {
    let parameters =
        LobeParameters { widths: [0.02, 0.05], angle: 0.6, ..lobe(LobeCentre::HalfVector, 2.0, 0.3).parameters() };
    Lobe::new(parameters).unwrap()
}

fn all() -> Vec<Lobe> {
    let mut all = vec![anisotropic()];
    for centre in CENTRES {
        for width in [0.5, 4.0, 20.0] {
            all.extend([0.0, 0.25, 0.5].map(|tail| lobe(centre, width, tail)));
        }
    }
    all
}

fn incidences() -> [Direction; 4] {
    [[0.0, 0.0], [25.0, 40.0], [60.0, 250.0], [85.0, 10.0]].map(|[theta, phi]| Direction::from_degrees(theta, phi))
}

/// Returns evenly spread points of the unit square (Roberts' sequence of the plastic number).
fn points(count: usize) -> impl Iterator<Item = [f64; 2]> {
    (0..count).map(|i| {
        let i = i as f64 + 0.5;
        [(i * 0.754_877_666_246_692_8).fract(), (i * 0.569_840_290_998_053_3).fract()]
    })
}

#[test]
fn the_centre_has_the_peak_and_one_half_width_has_half() {
    for centre in CENTRES {
        for tail in [0.0, 0.5] {
            let lobe = lobe(centre, 2.0, tail);
            let wi = Direction::from_degrees(0.0, 0.0);
            let peak = 3.0_f64.exp();
            assert!((lobe.shape(wi, wi) / peak - 1.0).abs() < 1e-6);
            assert!((lobe.full_widths()[0] - 2.0).abs() < 1e-3, "{:?}", lobe.full_widths());
            let half = lobe.shape(wi, Direction::from_degrees(1.0, 77.0)) / peak;
            assert!((half - 0.5).abs() < 2e-3, "{centre:?} {tail}: {half}");
            let wi = Direction::from_degrees(60.0, 30.0);
            let towards = if centre == LobeCentre::Source { 30.0 } else { 210.0 };
            let t = -(0.5_f64.ln());
            let found = lobe.shape(wi, Direction::from_degrees(60.0, towards));
            assert!((found / (3.0 + 0.4 * t + 0.1 * t * t).exp() - 1.0).abs() < 1e-6, "{centre:?}");
        }
    }
}

#[test]
fn nothing_is_reflected_below_the_horizon() {
    for lobe in all() {
        assert_eq!(lobe.shape(Direction::from_degrees(30.0, 0.0), Direction::from_degrees(91.0, 0.0)), 0.0);
        assert_eq!(lobe.shape(Direction::from_degrees(95.0, 0.0), Direction::from_degrees(30.0, 0.0)), 0.0);
        let under = lobe.under(Direction::from_degrees(89.0, 0.0)).unwrap();
        assert_eq!(under.density(Direction::from_degrees(100.0, 180.0)), 0.0);
    }
}

#[test]
fn densities_are_positive_where_the_lobe_is_and_their_integral_is_1() {
    let mesh = TriangleMesh::new(Domain::Hemisphere, 6).unwrap();
    for lobe in all().into_iter().filter(|lobe| lobe.full_widths()[0] > 3.0 && !lobe.is_anisotropic()) {
        for wi in incidences() {
            let under = lobe.under(wi).unwrap();
            // At grazing incidence the lobe is narrow in outgoing directions and may be finer than the cells.
            if lobe.full_widths()[0] * wi.cos_theta() < 4.0 {
                continue;
            }
            let sum: f64 = (0..mesh.len()).map(|i| mesh.solid_angle(i) * under.density(mesh.centroid(i))).sum();
            assert!((sum - 1.0).abs() < 0.02, "{lobe} under {} degrees: {sum}", wi.theta_degrees());
        }
    }
    for lobe in all() {
        for wi in incidences() {
            let under = lobe.under(wi).unwrap();
            for u in points(100) {
                let wo = Direction::from_degrees(90.0 * u[0], 360.0 * u[1]);
                assert!(under.density(wo) > 0.0 || under.shape(wo) < 1e-290, "{lobe} {wo:?}");
            }
        }
    }
}

#[test]
fn what_is_drawn_has_its_density_and_leads_back_to_its_point() {
    for lobe in all() {
        for wi in incidences() {
            let under = lobe.under(wi).unwrap();
            for u in points(200) {
                let wo = under.draw(u);
                assert!(wo.cos_theta() >= 0.0 && under.density(wo) > 0.0);
                let again = under.point_of(wo);
                let turned = (again[1] - u[1]).abs();
                assert!((again[0] - u[0]).abs() < 1e-6 && turned.min(1.0 - turned) < 1e-6, "{lobe} {u:?} {again:?}");
            }
            // Density over a small square of points: its area divided by the solid angle of its image.
            let corner = [0.4, 0.3];
            let step = 1e-4;
            let at = |x: f64, y: f64| under.draw([corner[0] + step * x, corner[1] + step * y]).xyz();
            let (a, b, c, d) = (at(0.0, 0.0), at(1.0, 0.0), at(1.0, 1.0), at(0.0, 1.0));
            let area = crate::domain::solid_angle([a, b, c]) + crate::domain::solid_angle([a, c, d]);
            let found = step * step / area;
            let expected = under.density(under.draw(corner.map(|x| x + 0.5 * step)));
            assert!((found / expected - 1.0).abs() < 2e-3, "{lobe} {}: {found} {expected}", wi.theta_degrees());
        }
    }
}

#[test]
fn the_light_is_the_sum_of_the_means_over_triangles() {
    let mesh = TriangleMesh::new(Domain::Hemisphere, 5).unwrap();
    for lobe in all() {
        for wi in incidences() {
            let under = lobe.under(wi).unwrap();
            let light = under.light();
            let mut sum = 0.0;
            for i in 0..mesh.len() {
                sum += under.mean_over(mesh.vertices(i)) * mesh.solid_angle(i);
            }
            let without_cosine: f64 = points(20_000)
                .map(|u| {
                    let wo = under.draw(u);
                    under.shape(wo) / under.density(wo)
                })
                .sum::<f64>()
                / 20_000.0;
            assert!((sum / without_cosine - 1.0).abs() < 0.01, "{lobe} {}: {sum} {without_cosine}", wi.theta_degrees());
            let fine: f64 = points(20_000)
                .map(|u| {
                    let wo = under.draw(u);
                    under.shape(wo) * wo.cos_theta() / under.density(wo)
                })
                .sum::<f64>()
                / 20_000.0;
            assert!((light / fine - 1.0).abs() < 1e-2, "{lobe} {}: {light} {fine}", wi.theta_degrees());
        }
    }
}

#[test]
fn beyond_the_measured_incidences_a_microfacet_lobe_keeps_its_albedo() {
    let wide = LobeParameters {
        range: [0.2, 0.5],
        peak: [3.0, 2.0, 0.0],
        ..lobe(LobeCentre::HalfVector, 2.0, 0.0).parameters()
    };
    let lobe = Lobe::new(wide).unwrap();
    let light = |theta: f64| lobe.under(Direction::from_degrees(theta, 0.0)).unwrap().light();
    // A peak of exp(2·t) is that of constant albedo; the range ends at 35° and 52.7°.
    let within = light(45.0);
    assert!((light(0.0) / within - 1.0).abs() < 0.01 && (light(20.0) / within - 1.0).abs() < 0.01, "{}", light(0.0));
    assert!((light(60.0) / within - 1.0).abs() < 0.02, "{}", light(60.0));
    let at_mirror = |theta: f64| {
        let wo = Direction::from_degrees(theta, 180.0);
        lobe.shape(Direction::from_degrees(theta, 0.0), wo) * wo.cos_theta()
    };
    assert!(at_mirror(89.0) <= 1.501 * at_mirror(52.67));
}

#[test]
fn numbers_out_of_bounds_are_refused() {
    let good = lobe(LobeCentre::Mirror, 2.0, 0.0).parameters();
    let wrong = [
        LobeParameters { widths: [0.0, 0.1], ..good.clone() },
        LobeParameters { widths: [0.1, f64::NAN], ..good.clone() },
        LobeParameters { tail: 0.6, ..good.clone() },
        LobeParameters { range: [0.5, 0.4], ..good.clone() },
        LobeParameters { peak: [f64::INFINITY, 0.0, 0.0], ..good.clone() },
        LobeParameters { colours: vec![-1.0], ..good.clone() },
    ];
    for parameters in wrong {
        let error = Lobe::new(parameters).unwrap_err();
        assert!(error.to_string().contains("of a lobe is"), "{error}");
    }
    let lobe = Lobe::new(good).unwrap();
    assert_eq!(Lobe::new(lobe.parameters()).unwrap(), lobe);
}
