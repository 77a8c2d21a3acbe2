//! Which state drives which state and which switch, and back: a graph in the language of Graphviz.
//!
//! An edge a -> b says that a occurs in what determines b: in the rate of a state, in ψ of a switch.

use std::collections::HashMap;

use petgraph::dot::{Config, Dot};
use petgraph::graph::{Graph, NodeIndex};

use crate::expr::{Expr, Var, variables_of};
use crate::system::System;

/// A node of the graph.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Vertex {
    /// A differential state with its name.
    State(String),
    /// A switch: the name of its surface, and whether the dynamics are continuous across it.
    Switch(String, bool),
}

/// The graph: states in order, then switches in order.
pub fn graph(system: &System) -> Graph<Vertex, ()> {
    let mut graph = Graph::new();
    let states = system.states.iter().map(|state| {
        let vertex = Vertex::State(state.name.clone());
        (state.var, state.rate, vertex)
    });
    let switches = system.switches.iter().map(|switch| {
        let vertex = Vertex::Switch(switch.name.clone(), switch.continuity.is_continuous());
        (switch.alpha, switch.psi, vertex)
    });
    let mut nodes: HashMap<Var, NodeIndex> = HashMap::new();
    let mut rules: Vec<(NodeIndex, Expr)> = Vec::new();
    for (var, rule, vertex) in states.chain(switches) {
        let node = graph.add_node(vertex);
        rules.push((node, rule));
        nodes.extend(var.as_variable().map(|var| (var, node)));
    }
    for (to, rule) in rules {
        let from = variables_of(&[rule]).into_iter();
        for from in from.filter_map(|var| nodes.get(&var)) {
            graph.add_edge(*from, to, ());
        }
    }
    graph
}

/// The graph as Graphviz text: states are ellipses, switches diamonds, dashed where they are continuous.
pub fn dot(system: &System) -> String {
    let graph = graph(system);
    let attributes = |_: &Graph<Vertex, ()>, (_, vertex): (NodeIndex, &Vertex)| match vertex {
        Vertex::State(name) => format!("label = {}", quote(name)),
        Vertex::Switch(name, continuous) => {
            let style = if *continuous { ", style = dashed" } else { "" };
            format!("label = {}, shape = diamond{style}", quote(name))
        }
    };
    let no_label = [Config::NodeNoLabel, Config::EdgeNoLabel];
    let dot = Dot::with_attr_getters(&graph, &no_label, &|_, _| String::new(), &attributes);
    // One newline ends the text; petgraph leaves empty brackets on edges and blanks inside brackets.
    let lines = format!("{dot:?}");
    let lines = lines.lines().map(|line| {
        line.trim_end()
            .replace(" [ ]", "")
            .replace("[ ", "[")
            .replace(" ]", "]")
    });
    lines.collect::<Vec<_>>().join("\n") + "\n"
}

fn quote(name: &str) -> String {
    let escaped = name
        .replace('\\', "\\\\")
        .replace('"', "\\\"")
        .replace(['\n', '\r'], " ");
    format!("\"{escaped}\"")
}
