//! Three views of a vehicle, from plain geometry in drawing coordinates.
//!
//! Coordinates are fuselage station (aft), butt line (to starboard) and water
//! line (up), all in one unit. The views are from port, from behind and from
//! above.

use std::f64::consts::PI;

use super::plot::{Anchor, Axis, Figure, Legend, Panel, Series, Tone};

/// A point or direction: station, butt line, water line.
pub type Point = [f64; 3];

/// A rotor: where, how large, how it stands.
#[derive(Debug, Clone, PartialEq)]
pub struct RotorView {
    /// Name.
    pub name: String,
    /// Style index.
    pub style: usize,
    /// Hub.
    pub hub: Point,
    /// Radius.
    pub radius: f64,
    /// Unit vectors of the hub frame: x forward, y to starboard, z down for an
    /// upright rotor.
    pub axes: [Point; 3],
    /// Whether it turns counter-clockwise seen against its z axis (from above).
    pub counter_clockwise: bool,
}

/// A flat surface such as a wing, by its corners.
#[derive(Debug, Clone, PartialEq)]
pub struct SurfaceView {
    /// Name.
    pub name: String,
    /// Corners in order around it.
    pub corners: Vec<Point>,
}

/// A body known by the areas that it turns to the wind.
#[derive(Debug, Clone, PartialEq)]
pub struct BodyView {
    /// Name.
    pub name: String,
    /// Where its loads act.
    pub position: Point,
    /// Equivalent areas seen from ahead, from the side and from above, if it
    /// is known by such.
    pub areas: Option<[f64; 3]>,
}

/// A vehicle.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleView {
    /// Unit of length.
    pub unit: String,
    /// Centre of gravity.
    pub center_of_gravity: Point,
    /// Rotors.
    pub rotors: Vec<RotorView>,
    /// Wings and tail surfaces.
    pub surfaces: Vec<SurfaceView>,
    /// Bodies.
    pub bodies: Vec<BodyView>,
}

/// A view: what lies along its axes.
#[derive(Debug, Clone, Copy)]
struct View {
    title: &'static str,
    /// Coordinates along x and y.
    axes: [usize; 2],
    names: [&'static str; 2],
    /// Which of a body's areas is seen.
    area: usize,
}

const VIEWS: [View; 3] = [
    View { title: "from port", axes: [0, 2], names: ["station, aft", "water line, up"], area: 1 },
    View {
        title: "from behind",
        axes: [1, 2],
        names: ["butt line, to starboard", "water line, up"],
        area: 0,
    },
    View {
        title: "from above",
        axes: [0, 1],
        names: ["station, aft", "butt line, to starboard"],
        area: 2,
    },
];

/// Points around a rotor disk.
const AROUND: usize = 72;
/// Share of the whole size left free around the vehicle.
const FREE: f64 = 0.08;

/// The three views, at one scale, with rotor disks, hub frames and centre of
/// gravity.
#[must_use]
pub fn three_view_figure(title: &str, vehicle: &VehicleView) -> Figure {
    let reach = extent(vehicle);
    let size = reach.iter().map(|(low, high)| high - low).fold(1e-6, f64::max) * (1.0 + 2.0 * FREE);
    let range = |k: usize| {
        let middle = 0.5 * (reach[k].0 + reach[k].1);
        (middle - 0.5 * size, middle + 0.5 * size)
    };
    VIEWS.iter().fold(
        Figure::new(title).columns(2).panel_size(300.0, 300.0).legend(Legend::Above),
        |figure, view| figure.panel(panel(vehicle, view, range, size)),
    )
}

fn ring(rotor: &RotorView) -> Vec<Point> {
    (0..=AROUND)
        .map(|k| {
            let (s, c) = (2.0 * PI * k as f64 / AROUND as f64).sin_cos();
            std::array::from_fn(|i| {
                rotor.hub[i] + rotor.radius * (c * rotor.axes[0][i] + s * rotor.axes[1][i])
            })
        })
        .collect()
}

fn extent(vehicle: &VehicleView) -> [(f64, f64); 3] {
    let mut points = vec![vehicle.center_of_gravity];
    points.extend(vehicle.rotors.iter().flat_map(ring));
    points.extend(vehicle.surfaces.iter().flat_map(|s| s.corners.iter().copied()));
    points.extend(vehicle.bodies.iter().map(|b| b.position));
    std::array::from_fn(|k| {
        points
            .iter()
            .map(|p| p[k])
            .filter(|v| v.is_finite())
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)))
    })
}

fn panel(
    vehicle: &VehicleView,
    view: &View,
    range: impl Fn(usize) -> (f64, f64),
    size: f64,
) -> Panel {
    let [a, b] = view.axes;
    let seen = |p: Point| [p[a], p[b]];
    let (x, y) = (range(a), range(b));
    let mut panel = Panel::new(
        Axis::linear(view.names[0], &vehicle.unit).range(x.0, x.1),
        Axis::linear(view.names[1], &vehicle.unit).range(y.0, y.1),
    )
    .title(view.title)
    .equal_aspect();
    for body in &vehicle.bodies {
        let area = body.areas.map_or(0.0, |areas| areas[view.area]);
        if area > 0.0 {
            // A disk of the same area: what the wind sees, not the shape.
            let radius = (area / PI).sqrt();
            let center = seen(body.position);
            let circle: Vec<[f64; 2]> = (0..AROUND)
                .map(|k| {
                    let (s, c) = (2.0 * PI * k as f64 / AROUND as f64).sin_cos();
                    [center[0] + radius * c, center[1] + radius * s]
                })
                .collect();
            let name = format!("{}: equivalent plate area", body.name);
            panel = panel.polygon(&circle, Tone::Neutral, &name);
        }
    }
    for surface in &vehicle.surfaces {
        let corners: Vec<[f64; 2]> = surface.corners.iter().map(|p| seen(*p)).collect();
        let mut closed = corners.clone();
        closed.extend(corners.first().copied());
        let line = Series::from_points("", closed).color(6).width(1.2);
        panel = panel.polygon(&corners, Tone::Neutral, "wings and tail surfaces");
        panel = panel.line(line.hint(&surface.name));
    }
    for rotor in &vehicle.rotors {
        let disk: Vec<[f64; 2]> = ring(rotor).into_iter().map(seen).collect();
        panel = panel
            .polygon(&disk, Tone::Style(rotor.style), "")
            .line(Series::from_points(&format!("{} rotor", rotor.name), disk).style(rotor.style));
        if view.axes == [0, 1] {
            panel = panel.line(turning(rotor, seen));
        }
        panel = hub_frame(panel, rotor, seen, 0.14 * size);
    }
    let center = seen(vehicle.center_of_gravity);
    panel.line(Series::from_points("centre of gravity", vec![center]).color(6).marker(7).scatter())
}

/// An arrow around the disk in the sense of rotation.
fn turning(rotor: &RotorView, seen: impl Fn(Point) -> [f64; 2]) -> Series {
    Series::from_points("", arrow(rotor).into_iter().map(seen).collect())
        .color(rotor.style)
        .hint(&format!("{} rotor turns this way", rotor.name))
}

/// The points of that arrow: 21 along its arc, then its head.
fn arrow(rotor: &RotorView) -> Vec<Point> {
    // From above, with x forward and y to starboard, the azimuth of a
    // counter-clockwise rotor runs from x towards -y.
    let sense = if rotor.counter_clockwise { -1.0 } else { 1.0 };
    let at = |angle: f64, radius: f64| {
        let (s, c) = angle.sin_cos();
        std::array::from_fn(|i| {
            rotor.hub[i]
                + radius * rotor.radius * (c * rotor.axes[0][i] + sense * s * rotor.axes[1][i])
        })
    };
    // Rotors one above the other turn at different radii, to be seen apart.
    let radius = if rotor.counter_clockwise { 0.72 } else { 0.84 };
    let mut points: Vec<Point> = (0..=20).map(|k| at(0.5 + 0.04 * f64::from(k), radius)).collect();
    points.extend([at(1.22, radius + 0.04), at(1.3, radius), at(1.22, radius - 0.04)]);
    points
}

/// The axes of the hub frame, named at their ends.
fn hub_frame(
    panel: Panel,
    rotor: &RotorView,
    seen: impl Fn(Point) -> [f64; 2],
    length: f64,
) -> Panel {
    let from = seen(rotor.hub);
    rotor.axes.iter().zip(["x", "y", "z"]).fold(panel, |panel, (axis, name)| {
        let tip: Point = std::array::from_fn(|i| rotor.hub[i] + length * axis[i]);
        let to = seen(tip);
        // An axis that points at the reader has no length to show.
        if (to[0] - from[0]).hypot(to[1] - from[1]) < 0.3 * length {
            return panel;
        }
        let anchor = if (to[0] - from[0]).abs() > (to[1] - from[1]).abs() {
            if to[0] > from[0] { Anchor::Right } else { Anchor::Left }
        } else if to[1] > from[1] {
            Anchor::Above
        } else {
            Anchor::Below
        };
        panel
            .line(
                Series::from_points("", vec![from, to])
                    .color(rotor.style)
                    .width(2.2)
                    .hint(&format!("{} hub frame, {name}", rotor.name)),
            )
            .text(to[0], to[1], name, anchor)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn vehicle() -> VehicleView {
        VehicleView {
            unit: "ft".into(),
            center_of_gravity: [0.0, 0.0, 0.0],
            rotors: vec![RotorView {
                name: "main".into(),
                style: 0,
                hub: [0.1, 0.0, 4.0],
                radius: 10.0,
                axes: [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]],
                counter_clockwise: true,
            }],
            surfaces: vec![SurfaceView {
                name: "fin".into(),
                corners: vec![
                    [9.0, 0.0, -2.0],
                    [10.0, 0.0, -2.0],
                    [10.0, 0.0, 2.0],
                    [9.0, 0.0, 2.0],
                ],
            }],
            bodies: vec![BodyView {
                name: "cabin".into(),
                position: [0.0; 3],
                areas: Some([14.0, 53.0, 50.0]),
            }],
        }
    }

    #[test]
    fn every_view_shows_the_disk_and_the_center() {
        let figure = three_view_figure("Views", &vehicle());
        assert!(figure.notes().is_empty(), "{:?}", figure.notes());
        let svg = figure.to_svg();
        assert_eq!(svg.matches("centre of gravity: 0 ft, 0 ft").count(), 3);
        // Hub frames: side x z, front y z, top x y.
        assert_eq!(svg.matches("main hub frame, ").count(), 12);
        assert_eq!(svg.matches("data-label=\"main rotor turns this way\"").count(), 1);
    }

    #[test]
    fn a_counter_clockwise_rotor_turns_from_the_nose_to_port() {
        // Seen from above with the nose ahead, counter-clockwise is to the left.
        let mut rotor = vehicle().rotors.remove(0);
        let butt_line = |rotor: &RotorView| [arrow(rotor)[0][1], arrow(rotor)[20][1]];
        let [start, end] = butt_line(&rotor);
        assert!(end < start && start < 0.0);
        rotor.counter_clockwise = false;
        let [start, end] = butt_line(&rotor);
        assert!(end > start && start > 0.0);
    }

    #[test]
    fn the_disk_is_as_large_as_its_rotor() {
        let v = vehicle();
        for p in ring(&v.rotors[0]) {
            let r = (0..3).map(|i| (p[i] - v.rotors[0].hub[i]).powi(2)).sum::<f64>().sqrt();
            assert!((r - 10.0).abs() < 1e-12);
        }
        assert_eq!(extent(&v)[0].1, 10.1);
    }
}
