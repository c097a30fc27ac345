use std::collections::BTreeMap;
use std::fmt::Write as _;

use drape_cloth::mesh::{OrientationFault, TriMesh, border};

/// Length of the marks along the yarns [m].
const MARK: f64 = 0.05;
/// Height of the numbers of strokes [mm].
const TEXT: f64 = 5.0;

/// The flat blank with what is done to it, to be cut, marked and pressed.
#[derive(Clone, Debug)]
pub struct FlatPattern<'a> {
    /// The flat blank [m].
    pub blank: &'a TriMesh,
    /// Unit vector along the warp; the weft is that turned to the left.
    pub warp: [f64; 2],
    /// Vertices that are held.
    pub clamped: &'a [u32],
    /// Vertices of each stroke, in order; a stroke of one is a press.
    pub strokes: &'a [Vec<u32>],
}

impl FlatPattern<'_> {
    /// The pattern as DXF of release 12 in millimetres, on the layers OUTLINE, WARP, WEFT, CLAMPS and STROKES. Strokes run
    /// from their number on.
    ///
    /// # Errors
    /// If the triangles of the blank do not agree on which side is up.
    pub fn dxf(&self) -> Result<String, OrientationFault> {
        let mut dxf = Dxf::default();
        dxf.pairs(&[
            (0, "SECTION"),
            (2, "HEADER"),
            (9, "$ACADVER"),
            (1, "AC1009"),
        ]);
        // Millimetres.
        dxf.pairs(&[
            (9, "$INSUNITS"),
            (70, "4"),
            (0, "ENDSEC"),
            (0, "SECTION"),
            (2, "TABLES"),
        ]);
        dxf.pairs(&[(0, "TABLE"), (2, "LAYER"), (70, "5")]);
        for (name, color) in LAYERS {
            dxf.pairs(&[
                (0, "LAYER"),
                (2, name),
                (70, "0"),
                (62, color),
                (6, "CONTINUOUS"),
            ]);
        }
        dxf.pairs(&[
            (0, "ENDTAB"),
            (0, "ENDSEC"),
            (0, "SECTION"),
            (2, "ENTITIES"),
        ]);
        let at = |v: &u32| {
            let place = self.blank.vertices[*v as usize];
            [place.x, place.y]
        };
        for outline in loops(border(self.blank)?) {
            let places: Vec<_> = outline.iter().map(at).collect();
            dxf.polyline("OUTLINE", &places, CLOSED);
        }
        let (low, high) = self.blank.bounds();
        let middle = [0, 1].map(|k| 0.5 * (low[k] + high[k]));
        let [x, y] = self.warp;
        for (layer, along) in [("WARP", [x, y]), ("WEFT", [-y, x])] {
            let end = |sign: f64| [0, 1].map(|k| middle[k] + sign * 0.5 * MARK * along[k]);
            dxf.polyline(layer, &[end(-1.0), end(1.0)], OPEN);
            dxf.text(layer, end(1.0), &layer.to_lowercase());
        }
        for vertex in self.clamped {
            dxf.entity("POINT", "CLAMPS");
            dxf.place(at(vertex));
        }
        for (number, stroke) in self.strokes.iter().enumerate() {
            let places: Vec<_> = stroke.iter().map(at).collect();
            let Some(&first) = places.first() else {
                continue;
            };
            match &places[..] {
                [_] => {
                    dxf.entity("POINT", "STROKES");
                    dxf.place(first);
                }
                _ => dxf.polyline("STROKES", &places, OPEN),
            }
            dxf.text("STROKES", first, &(number + 1).to_string());
        }
        dxf.pairs(&[(0, "ENDSEC"), (0, "EOF")]);
        Ok(dxf.text)
    }
}

/// Layers and their colours.
const LAYERS: [(&str, &str); 5] = [
    ("OUTLINE", "7"),
    ("WARP", "5"),
    ("WEFT", "3"),
    ("CLAMPS", "1"),
    ("STROKES", "6"),
];

/// Flags of polylines.
const OPEN: &str = "0";
const CLOSED: &str = "1";

/// Closed loops of vertices along directed edges. No two loops touch, or the blank would not hang together there.
fn loops(edges: Vec<[u32; 2]>) -> Vec<Vec<u32>> {
    let mut next: BTreeMap<u32, u32> = edges.into_iter().map(|[from, to]| (from, to)).collect();
    let mut loops = Vec::new();
    while let Some((mut at, mut to)) = next.pop_first() {
        let mut found = vec![at];
        loop {
            at = to;
            match next.remove(&at) {
                Some(after) => to = after,
                None => break,
            }
            found.push(at);
        }
        loops.push(found);
    }
    loops
}

#[derive(Default)]
struct Dxf {
    text: String,
}

impl Dxf {
    fn pairs(&mut self, pairs: &[(u32, &str)]) {
        for (code, value) in pairs {
            let _ = writeln!(self.text, "{code}\n{value}");
        }
    }

    fn entity(&mut self, kind: &str, layer: &str) {
        self.pairs(&[(0, kind), (8, layer)]);
    }

    /// Where an entity is [m].
    fn place(&mut self, at: [f64; 2]) {
        let [x, y] = at.map(|x| format!("{:.6}", 1e3 * x));
        self.pairs(&[(10, &x), (20, &y), (30, "0.0")]);
    }

    fn polyline(&mut self, layer: &str, places: &[[f64; 2]], flag: &str) {
        self.entity("POLYLINE", layer);
        // Vertices follow.
        self.pairs(&[(66, "1")]);
        self.place([0.0; 2]);
        self.pairs(&[(70, flag)]);
        for &at in places {
            self.entity("VERTEX", layer);
            self.place(at);
        }
        self.entity("SEQEND", layer);
    }

    fn text(&mut self, layer: &str, at: [f64; 2], text: &str) {
        self.entity("TEXT", layer);
        self.place(at);
        self.pairs(&[(40, &format!("{TEXT:.1}")), (1, text)]);
    }
}
