//! Polygons cut into triangles.

use std::collections::HashMap;

use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation, mitigate_underflow};

use super::stl::{Facet, has_area};
use crate::math::Vec3;

/// Facets of a polygon through `corners`, which may be concave: a Delaunay triangulation within its
/// border, in the plane across its area vector where it is not plane. Every corner is that of a facet,
/// also one on a straight side. What has no area at all becomes facets without one.
///
/// None of a polygon whose border crosses or touches itself; it may run there and back again, as a cut
/// to a hole does. One with a corner that is nowhere keeps it.
pub(super) fn cut(corners: &[Vec3]) -> Option<Vec<Facet>> {
    let fan = |first: usize| {
        let at = |k: usize| corners[(first + k) % corners.len()];
        let facets = (1..corners.len().max(2) - 1).map(|k| [at(0), at(k), at(k + 1)]);
        facets.collect::<Vec<Facet>>()
    };
    let area = |[a, b, c]: &Facet| (b - a).cross(&(c - a));
    let mut normal: Vec3 = fan(0).iter().map(area).sum();
    let is_upward = |facet: &Facet| has_area(facet) && area(facet).dot(&normal) > 0.0;
    match corners.len() {
        0..=3 => return Some(fan(0)),
        // One of its diagonals lies inside.
        4 => {
            let fans = [0, 1].map(fan).into_iter();
            if let Some(fan) = fans.into_iter().find(|fan| fan.iter().all(is_upward)) {
                return Some(fan);
            }
        }
        _ => {}
    }
    if !fan(0).iter().any(has_area) || !normal.iter().all(|x| x.is_finite()) {
        return Some(fan(0));
    }
    let areas = fan(0).into_iter().map(|facet| area(&facet));
    let largest = areas.max_by(|a, b| a.norm().total_cmp(&b.norm()));
    let largest = largest.expect("some have an area");
    // All of it runs there and back, but for rounding.
    if normal.norm() < 1e-12 * largest.norm() {
        normal = largest;
    }
    triangulate(corners, normal.try_normalize(0.0)?)
}

/// The inside of a polygon in the plane across a unit `normal`.
fn triangulate(corners: &[Vec3], normal: Vec3) -> Option<Vec<Facet>> {
    let along = normal.cross(&Vec3::ith(normal.iamin(), 1.0)).normalize();
    let across = normal.cross(&along);
    let reach = corners.iter().map(|x| (x - corners[0]).amax());
    let reach = reach.fold(0.0, f64::max);
    let mut plane = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let (mut ring, mut places) = (Vec::new(), HashMap::new());
    for &corner in corners {
        let x = (corner - corners[0]) / reach;
        let point = Point2::new(x.dot(&along), x.dot(&across));
        let vertex = plane.insert(mitigate_underflow(point)).ok()?;
        places.entry(vertex).or_insert(corner);
        ring.push(vertex);
    }
    // How often the border runs along an edge, less how often it runs back.
    let mut runs = HashMap::new();
    for (k, &from) in ring.iter().enumerate() {
        let to = ring[(k + 1) % ring.len()];
        if from != to {
            if !plane.can_add_constraint(from, to) {
                return None;
            }
            plane.add_constraint(from, to);
            *runs.entry([from, to]).or_insert(0) += 1;
            *runs.entry([to, from]).or_insert(0) -= 1;
        }
    }
    if !(runs.keys()).all(|&[from, to]| plane.exists_constraint(from, to)) {
        return None;
    }
    // From the outside across edge after edge: how often the border runs round each face.
    let mut windings = vec![None; plane.num_all_faces()];
    windings[plane.outer_face().index()] = Some(0);
    let mut edges: Vec<_> = plane.convex_hull().collect();
    while let Some(edge) = edges.pop() {
        let (winding, beside) = (windings[edge.face().index()], edge.rev());
        let ends = beside.vertices().map(|vertex| vertex.fix());
        let run = runs.get(&ends).copied().unwrap_or(0);
        let found = &mut windings[beside.face().index()];
        if let (None, Some(face)) = (*found, beside.face().as_inner()) {
            *found = winding.map(|winding| winding + run);
            edges.extend(face.adjacent_edges());
        }
    }
    let (mut facets, mut is_simple) = (Vec::new(), true);
    for face in plane.inner_faces() {
        match windings[face.index()] {
            Some(1) => facets.push(face.vertices().map(|vertex| places[&vertex.fix()])),
            winding => is_simple &= winding == Some(0),
        }
    }
    is_simple.then_some(facets)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(corners: &[[f64; 3]]) -> Vec<Vec3> {
        corners.iter().map(|&x| Vec3::from(x)).collect()
    }

    /// The area vector of what a polygon is cut into, the sum of the areas, and the number of facets.
    fn measured(corners: &[Vec3]) -> Option<(Vec3, f64, usize)> {
        let facets = cut(corners)?;
        let area = |[a, b, c]: &Facet| 0.5 * (b - a).cross(&(c - a));
        let sum = facets.iter().map(area).sum();
        let areas = facets.iter().map(|facet| area(facet).norm()).sum();
        Some((sum, areas, facets.len()))
    }

    /// Polygons of a known area, from every corner on, either way round and in any plane, are covered
    /// once by n - 2 facets, however concave.
    #[test]
    fn polygons_are_covered_once() {
        let spiral = (0..40).map(|k| {
            let (turn, out) = (f64::from(k.min(39 - k)) * 0.5, f64::from(u8::from(k < 20)));
            let r = 1.0 + 0.2 * turn + 0.1 * out;
            [r * turn.cos(), r * turn.sin(), 0.0]
        });
        let spiral: Vec<_> = spiral.collect();
        let exact = |corners: &[[f64; 3]]| {
            let next = corners.iter().cycle().skip(1);
            let sides = corners.iter().zip(next);
            sides
                .map(|(p, q)| 0.5 * (p[0] * q[1] - p[1] * q[0]))
                .sum::<f64>()
        };
        let u = [
            [0., 0., 0.],
            [3., 0., 0.],
            [3., 3., 0.],
            [2., 3., 0.],
            [2., 1., 0.],
            [1., 1., 0.],
            [1., 3., 0.],
            [0., 3., 0.],
        ];
        let chevron = [[0., 0., 0.], [2., 1., 0.], [0., 2., 0.], [1., 1., 0.]];
        // With corners on its straight sides, and one that is there twice.
        let straight = [
            [0., 0., 0.],
            [0.1, 0., 0.],
            [0.3, 0., 0.],
            [1., 0., 0.],
            [0.5, 0.7, 0.],
            [0.25, 0.35, 0.],
        ];
        // A square with a hole, cut open to it.
        let ring = [
            [0., 0., 0.],
            [4., 0., 0.],
            [4., 4., 0.],
            [0., 4., 0.],
            [0., 0., 0.],
            [1., 1., 0.],
            [1., 3., 0.],
            [3., 3., 0.],
            [3., 1., 0.],
            [1., 1., 0.],
        ];
        let turns = nalgebra::Rotation3::from_euler_angles(0.7, -0.4, 2.0);
        for corners in [&u[..], &chevron, &straight, &ring, &spiral] {
            let flat = exact(corners);
            let normal = turns * Vec3::z() * flat;
            for first in 0..corners.len() {
                let mut turned: Vec<Vec3> =
                    points(corners).iter().map(|x| turns * x * 1e-3).collect();
                turned.rotate_left(first);
                for side in [1.0, -1.0] {
                    let (sum, areas, count) = measured(&turned).unwrap();
                    assert!((sum * 1e6 - side * normal).norm() < 1e-9, "{first}: {sum}");
                    assert!((areas * 1e6 - flat.abs()).abs() < 1e-9, "{first}: {areas}");
                    assert_eq!(count, corners.len() - 2);
                    turned.reverse();
                }
            }
        }
    }

    #[test]
    fn polygons_out_of_plane_are_cut_in_their_best_one() {
        // A star that waves: every corner is kept, and each side is that of one facet.
        let corner = |k: u32| {
            let (angle, r) = (
                f64::from(k) * std::f64::consts::TAU / 10.0,
                1.0 + f64::from(k % 2),
            );
            Vec3::new(r * angle.cos(), r * angle.sin(), 0.1 * (3.0 * angle).sin())
        };
        let corners: Vec<Vec3> = (0..10).map(corner).collect();
        let facets = cut(&corners).unwrap();
        assert_eq!(facets.len(), 8);
        for k in 0..10 {
            let side = [corners[k], corners[(k + 1) % 10]];
            let has = |[a, b, c]: &&Facet| [[*a, *b], [*b, *c], [*c, *a]].contains(&side);
            assert_eq!(facets.iter().filter(has).count(), 1);
        }
    }

    #[test]
    fn what_cannot_be_cut_is_refused_and_what_has_no_area_is_left() {
        let bow = points(&[[0., 0., 0.], [2., 2., 0.], [2., 0., 0.], [0., 3., 0.]]);
        let star =
            [0.0f64, 2.0, 4.0, 1.0, 3.0].map(|k| (k * std::f64::consts::TAU / 5.0).sin_cos());
        let star: Vec<Vec3> = star.iter().map(|&(y, x)| Vec3::new(x, y, 0.0)).collect();
        let touching = points(&[
            [0., 0., 0.],
            [4., 0., 0.],
            [4., 4., 0.],
            [2., 0., 0.],
            [0., 4., 0.],
        ]);
        for corners in [bow, star, touching] {
            assert_eq!(cut(&corners), None, "{corners:?}");
        }
        let line = points(&[
            [0., 0., 0.],
            [1., 0., 0.],
            [2., 0., 0.],
            [1.5, 0., 0.],
            [0.5, 0., 0.],
        ]);
        assert_eq!(measured(&line).unwrap(), (Vec3::zeros(), 0.0, 3));
        assert_eq!(cut(&line[..2]), Some(Vec::new()));
        let [a, b, c, d] = [
            [0.1, 0.2, 0.],
            [3.3, 1.7, 0.],
            [1.1, 2.9, 0.],
            [0.3, 0.7, 0.],
        ];
        for spike in [&[a, b, c, b][..], &[a, b, c, d, c, b]] {
            assert_eq!(cut(&points(spike)), Some(Vec::new()), "{spike:?}");
        }
        // Whose place is told where it is read.
        for x in [f64::NAN, f64::INFINITY] {
            let facets = cut(&points(&[a, b, [x, 0., 0.], c, d])).unwrap();
            assert!(facets.iter().flatten().any(|p| !p.x.is_finite()), "{x}");
        }
    }
}
