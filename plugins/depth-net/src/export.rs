//! The network as an ONNX file. The map of the floor is made outside of it.

use tagalong_config::{Context, ExportedNetwork, NamedTensor};
use tagalong_core::Result;
use tagalong_learn::conv::Map;
use tagalong_learn::onnx::{Attribute, OnnxGraph};

use crate::net::{HEAD_M, Net};
use crate::{BUILT_IN, Config, FloorMap, Model, NAME, Pass};

/// Cells per side of the fine and the coarse grid.
const COARSE_CELLS: usize = FloorMap::CELLS;
const FINE_CELLS: usize = 2 * FloorMap::CELLS;
/// Shapes of the inputs and outputs.
const FINE: [usize; 4] = [1, FloorMap::FINE, FINE_CELLS, FINE_CELLS];
const COARSE: [usize; 4] = [1, FloorMap::COARSE, COARSE_CELLS, COARSE_CELLS];
const ONE: [usize; 4] = [1, 1, COARSE_CELLS, COARSE_CELLS];
const HEAD: [usize; 4] = [1, 3, COARSE_CELLS, COARSE_CELLS];

const CARD: &str = r#"name = "depth-net"
licence = "MIT OR Apache-2.0"
task = "people in a plan view of a depth image; scores in configs/models/depth-net.card.toml"
# The camera's height and tilt turn depth into points of the robot's frame: x forwards, y to the
# left, z up, m, from the floor. Row 0 of both grids begins 0.2 m in front of the robot, column 0
# at 3.2 m to its right; rows run forwards, columns to the left. `FloorMap` in plugins/depth-net
# computes the inputs.

[inputs]
fine = """[1, 11, 128, 128], cells of 5 cm. Channels 0 to 9: for slabs of 20 cm from 0.1 m upwards \
the root of the surface that the pixels of its points cover, relative to 5 cm x 20 cm, at most 1. A \
pixel covers its depth over the focal length, squared. Channel 10: half the greatest height, m. \
Points above 2.3 m are left out."""
coarse = """[1, 10, 64, 64], cells of 10 cm. For a voxel at the heights 0.3, 0.7, 1.1, 1.5 and \
1.9 m: 1 if the depth at its pixel is more than 0.12 m behind it (it is empty), then 1 if the depth \
is more than 0.12 m in front of it (it is hidden); otherwise 0."""
in_view = """[1, 1, 64, 64]: 1 for cells with a voxel inside the image and those up to three cells \
beside them, otherwise 0. All layers are zero elsewhere."""

[outputs]
log_odds = "[1, 1, 64, 64]: calibrated log-odds of a head above the cell; peaks in view are people"
head = "[1, 3, 64, 64]: place of the head from the centre of the cell (x, y), and its height, m"
"#;

/// Returns the network as an ONNX file, with its card and a sample.
pub(crate) fn export(config: Config, context: &Context) -> Result<ExportedNetwork> {
    let model = context.model(&config.model, BUILT_IN, Model::from_text)?;
    let onnx = graph(&model).to_bytes();
    Ok(ExportedNetwork::new(onnx, CARD.to_owned(), sample(&model)))
}

fn graph(model: &Model) -> OnnxGraph {
    fn part(graph: &mut OnnxGraph, output: &str, from: usize, count: usize) {
        let choice: Vec<f32> =
            (0..4 * count).map(|at| f32::from(at % 4 == from + at / 4)).collect();
        let name = format!("{output}.choice");
        graph.constant(&name, &[count, 4, 1, 1], &choice);
        let kernel = [("kernel_shape", Attribute::Ints(&[1, 1]))];
        graph.operator("Conv", &["shifted", &name], output, &kernel);
    }

    let Net { first, second, third, fourth, fifth, last } = &model.net;
    let mut graph = OnnxGraph::new(NAME);
    graph.note("card", CARD);
    graph.input("fine", &FINE);
    graph.input("coarse", &COARSE);
    graph.input("in_view", &ONE);
    graph.conv(first, "fine", "first");
    let first = rectified(&mut graph, "first");
    graph.operator("Concat", &[&first, "coarse"], "joined", &[("axis", Attribute::Int(1))]);
    graph.conv(second, "joined", "second");
    let second = rectified(&mut graph, "second");
    graph.conv(third, &second, "third");
    let third = rectified(&mut graph, "third");
    graph.conv(fourth, &third, "fourth");
    let fourth = rectified(&mut graph, "fourth");
    graph.conv(fifth, &fourth, "fifth");
    let fifth = rectified(&mut graph, "fifth");
    graph.conv(last, &fifth, "last");
    graph.operator("Mul", &["last", "in_view"], "answer", &[]);
    // The first number of a cell is calibrated; the last is relative to a usual height.
    let [slope, offset] = [model.slope as f32, model.offset as f32];
    graph.constant("scale", &[1, 4, 1, 1], &[slope, 1.0, 1.0, 1.0]);
    graph.constant("shift", &[1, 4, 1, 1], &[offset, 0.0, 0.0, HEAD_M]);
    graph.operator("Mul", &["answer", "scale"], "scaled", &[]);
    graph.operator("Add", &["scaled", "shift"], "shifted", &[]);
    part(&mut graph, "log_odds", 0, 1);
    part(&mut graph, "head", 1, 3);
    graph.output("log_odds", &ONE);
    graph.output("head", &HEAD);
    graph
}

/// Cuts off sums below zero, and all cells out of view; returns the name of the result.
fn rectified(graph: &mut OnnxGraph, sums: &str) -> String {
    let positive = format!("{sums}.positive");
    let result = format!("{sums}.in_view");
    graph.operator("Relu", &[sums], &positive, &[]);
    graph.operator("Mul", &[&positive, "in_view"], &result, &[]);
    result
}

/// Returns the planes of a map: its channels one after the other, as files have them.
fn planes<const CHANNELS: usize>(map: &Map<CHANNELS>) -> Vec<f32> {
    let cells = map.values.as_chunks::<CHANNELS>().0;
    (0..CHANNELS).flat_map(|channel| cells.iter().map(move |cell| cell[channel])).collect()
}

/// Returns a map of even noise in three quarters of the view, and the answer of the network.
fn sample(model: &Model) -> Vec<NamedTensor> {
    let mut map = FloorMap {
        fine: Map::new(FINE_CELLS, FINE_CELLS),
        coarse: Map::new(COARSE_CELLS, COARSE_CELLS),
        in_view: (0..COARSE_CELLS * COARSE_CELLS)
            .map(|cell| cell % COARSE_CELLS / 16 != 1)
            .collect(),
    };
    let mut state = 1;
    for value in &mut map.fine.values {
        *value = next_value(&mut state) * next_value(&mut state);
    }
    for value in &mut map.coarse.values {
        *value = next_value(&mut state).round();
    }
    named(model, &map)
}

/// Returns the next value of a linear congruential generator: the values only have to differ.
fn next_value(state: &mut u32) -> f32 {
    *state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
    (*state >> 16) as f32 / 65_536.0
}

/// Returns the inputs of the file for a map, and the outputs that it must have.
pub(crate) fn named(model: &Model, map: &FloorMap) -> Vec<NamedTensor> {
    let mut pass = Pass::default();
    model.net.look(map, &mut pass);
    let cells: Vec<[usize; 2]> = (0..COARSE_CELLS * COARSE_CELLS)
        .map(|cell| [cell / COARSE_CELLS, cell % COARSE_CELLS])
        .collect();
    let log_odds = cells
        .iter()
        .map(|[row, column]| model.log_odds(f64::from(pass.logit(*row, *column))) as f32);
    let head = (0..3).flat_map(|axis| {
        let pass = &pass;
        cells.iter().map(move |[row, column]| pass.head(*row, *column)[axis])
    });
    let in_view = map.in_view.iter().map(|seen| f32::from(*seen));
    vec![
        NamedTensor::input("fine", &FINE, planes(&map.fine)),
        NamedTensor::input("coarse", &COARSE, planes(&map.coarse)),
        NamedTensor::input("in_view", &ONE, in_view.collect()),
        NamedTensor::output("log_odds", &ONE, log_odds.collect()),
        NamedTensor::output("head", &HEAD, head.collect()),
    ]
}
