//! The workflow as a graph: for planning, and as DOT and Mermaid text.

use crate::resolved::{ResolvedStep, ResolvedWorkflow};
use petgraph::graph::{DiGraph, NodeIndex};
use std::collections::BTreeMap;
use std::fmt::Write;

/// Names of the steps that must be done before this one can be planned or run: those whose artifacts it
/// receives, then those whose collections it fans over. Each once.
pub fn dependencies(step: &ResolvedStep) -> Vec<&str> {
    let mut names: Vec<&str> = Vec::new();
    let given = step.inputs.iter().map(|i| i.from.as_str());
    for name in given.chain(step.dimensions.iter().map(|d| d.over.as_str())) {
        if !names.contains(&name) {
            names.push(name);
        }
    }
    names
}

/// The DAG: a node per step (in topological order), an edge per dependency. An edge carries the ports it
/// feeds; it is empty where a step only fans over a collection.
pub fn graph(workflow: &ResolvedWorkflow) -> DiGraph<&ResolvedStep, Vec<&str>> {
    let mut graph = DiGraph::new();
    let nodes: BTreeMap<&str, NodeIndex> = workflow
        .steps
        .iter()
        .map(|s| (s.name.as_str(), graph.add_node(s)))
        .collect();
    for step in &workflow.steps {
        for from in dependencies(step) {
            let ports: Vec<&str> = step
                .inputs
                .iter()
                .filter(|i| i.from == from)
                .map(|i| i.port.as_str())
                .collect();
            if let (Some(&a), Some(&b)) = (nodes.get(from), nodes.get(step.name.as_str())) {
                graph.add_edge(a, b, ports);
            }
        }
    }
    graph
}

/// "local x N (from zones)".
fn label(step: &ResolvedStep) -> String {
    let mut label = step.name.clone();
    if !step.dimensions.is_empty() {
        let over: Vec<&str> = step.dimensions.iter().map(|d| d.over.as_str()).collect();
        let _ = write!(label, " x N (from {})", over.join(", "));
    }
    label
}

/// Graphviz text.
pub fn to_dot(workflow: &ResolvedWorkflow) -> String {
    let quote = |s: &str| {
        let text = s.replace('\\', "\\\\").replace('"', "\\\"");
        format!("\"{}\"", text.replace('\n', "\\n"))
    };
    let mut out = format!(
        "digraph {} {{\n  rankdir=LR;\n  node [shape=box];\n",
        quote(&workflow.name)
    );
    let graph = graph(workflow);
    for step in graph.node_weights() {
        let text = quote(&format!("{}\n{}", label(step), step.plugin.name));
        let _ = writeln!(out, "  {} [label={text}];", quote(&step.name));
    }
    for edge in graph.edge_indices() {
        let Some((a, b)) = graph.edge_endpoints(edge) else {
            continue;
        };
        let ports = &graph[edge];
        let style = if ports.is_empty() {
            "style=dashed".to_owned()
        } else {
            format!("label={}", quote(&ports.join(", ")))
        };
        let _ = writeln!(
            out,
            "  {} -> {} [{style}];",
            quote(&graph[a].name),
            quote(&graph[b].name)
        );
    }
    out + "}\n"
}

/// Mermaid text (`flowchart LR`), which Markdown viewers draw.
pub fn to_mermaid(workflow: &ResolvedWorkflow) -> String {
    let mut out = String::from("flowchart LR\n");
    let graph = graph(workflow);
    for node in graph.node_indices() {
        let step = graph[node];
        // Numbered ids: step names may be words of the Mermaid language.
        let text = format!("{}<br/>{}", label(step), step.plugin.name).replace('"', "#quot;");
        let _ = writeln!(out, "  s{}[\"{text}\"]", node.index());
    }
    for edge in graph.edge_indices() {
        let Some((a, b)) = graph.edge_endpoints(edge) else {
            continue;
        };
        let arrow = match graph[edge].as_slice() {
            [] => "-.->".to_owned(),
            ports => format!("-->|\"{}\"|", ports.join(", ")),
        };
        let _ = writeln!(out, "  s{} {arrow} s{}", a.index(), b.index());
    }
    out
}
