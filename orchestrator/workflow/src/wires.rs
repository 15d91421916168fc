//! Wires and fan-outs: who gives what to whom, in which order steps can run, and over what each is
//! fanned out.

use crate::diagnostics::{Problems, Source};
use crate::draft::Draft;
use crate::resolved::{Dimension, ResolvedInput};
use crate::yaml::{Kind, Node, Span};
use petgraph::graph::{DiGraph, NodeIndex};
use plyflow_model::manifest::{InputPort, Manifest};
use plyflow_model::text::{WORD, is_word};
use std::cmp::Reverse;
use std::collections::{BTreeSet, BinaryHeap, HashMap, HashSet};

/// All wires of a workflow; indices are positions in the file.
pub(crate) struct Wiring {
    /// Wires of each step, in the order of its ports.
    pub inputs: Vec<Vec<ResolvedInput>>,
    /// Fan-out of each step, outermost first.
    pub dimensions: Vec<Vec<Dimension>>,
    /// Steps in topological order, ties in the order of the file; empty when there is a cycle.
    pub order: Vec<usize>,
}

/// How many steps a remedy names at most.
const NAMED: usize = 8;

/// A wire as it stands in the file.
struct Wire {
    port: String,
    from: usize,
    to: usize,
    span: Span,
}

/// Reads `from` and `for_each` of all steps; everything wrong is reported.
pub(crate) fn connect(drafts: &[Draft<'_>], source: &Source, problems: &mut Problems) -> Wiring {
    let index = drafts
        .iter()
        .enumerate()
        .map(|(i, d)| (d.name(), i))
        .collect();
    let mut reader = Reader {
        drafts,
        index,
        source,
        problems,
        wires: Vec::new(),
    };
    for to in 0..drafts.len() {
        reader.inputs(to);
    }
    let fans: Vec<Vec<(String, usize, Span)>> =
        (0..drafts.len()).map(|to| reader.fans(to)).collect();
    let wires = std::mem::take(&mut reader.wires);
    let mut edges: Vec<(usize, usize, Span)> = wires
        .iter()
        .map(|w| (w.from, w.to, w.span.clone()))
        .collect();
    for (to, fan) in fans.iter().enumerate() {
        edges.extend(fan.iter().map(|(_, over, span)| (*over, to, span.clone())));
    }
    let order = order(drafts, &edges, source, problems);
    let dimensions = dimensions(drafts, &fans, &order);
    gathered(drafts, &wires, &dimensions, source, problems);
    let inputs = (0..drafts.len())
        .map(|to| {
            let start = wires.partition_point(|w| w.to < to);
            let end = wires.partition_point(|w| w.to <= to);
            in_order_of_ports(&drafts[to], &wires[start..end], drafts)
        })
        .collect();
    Wiring {
        inputs,
        dimensions,
        order,
    }
}

struct Reader<'a, 'n> {
    drafts: &'a [Draft<'n>],
    /// Step name -> its position.
    index: HashMap<&'a str, usize>,
    source: &'a Source,
    problems: &'a mut Problems,
    /// By receiving step, in the order of the file.
    wires: Vec<Wire>,
}

impl Reader<'_, '_> {
    fn step(&mut self, node: &Node) -> Option<usize> {
        let name = node.text()?;
        let found = self.index.get(name).copied();
        if found.is_none() {
            let d = self.problems.add(
                self.source,
                &node.span,
                format!("there is no step `{name}`"),
            );
            d.given(name)
                .suggest(name, self.drafts.iter().map(|d| d.name()));
        }
        found
    }

    fn inputs(&mut self, to: usize) {
        let draft = &self.drafts[to];
        let manifest = draft.plugin.as_ref().map(|p| &p.manifest);
        let from = draft
            .entry
            .value
            .entry("from")
            .filter(|e| e.value.kind != Kind::Null);
        let first_wire = self.wires.len();
        let mut mentioned: Vec<&str> = Vec::new();
        match from.map(|e| &e.value) {
            Some(
                node @ Node {
                    kind: Kind::Text(_),
                    ..
                },
            ) => {
                let port = manifest.and_then(|m| self.only_port(m, node));
                if manifest.is_some() && port.is_none() {
                    return;
                }
                self.wire(to, port, node);
            }
            Some(Node {
                kind: Kind::Map(entries),
                ..
            }) => {
                for entry in entries {
                    mentioned.push(&entry.key);
                    let port = manifest.and_then(|m| self.port(m, entry));
                    let givers = match &entry.value.kind {
                        Kind::List(items) => items.as_slice(),
                        _ => std::slice::from_ref(&entry.value),
                    };
                    if givers.len() > 1 && port.is_some_and(|(_, p)| !p.many) {
                        let message = format!("port `{}` takes one artifact", entry.key);
                        let d = self.problems.add(self.source, &entry.value.span, message);
                        d.given(format!("{} steps", givers.len()))
                            .expected("one step name");
                    }
                    for giver in givers {
                        self.wire(to, port, giver);
                    }
                }
            }
            _ => {}
        }
        let Some(manifest) = manifest else { return };
        let at = from.map_or(&draft.entry.key_span, |e| &e.key_span);
        for (name, port) in manifest.inputs.iter().filter(|(_, p)| p.required) {
            let wired = self.wires[first_wire..].iter().any(|w| w.port == *name);
            if !wired && !mentioned.contains(&name.as_str()) {
                self.missing(to, name, port, at);
            }
        }
    }

    fn missing(&mut self, to: usize, name: &str, port: &InputPort, at: &Span) {
        let draft = &self.drafts[to];
        let message = format!("step `{}` does not wire its input `{name}`", draft.name());
        let givers: Vec<&str> = (0..self.drafts.len())
            .filter(|&i| i != to && kind(&self.drafts[i]).is_some_and(|k| port.accepts(k)))
            .map(|i| self.drafts[i].name())
            .take(NAMED)
            .collect();
        let d = self.problems.add(self.source, at, message);
        d.expected(format!(
            "`from: {{{name}: <step that gives `{}`>}}`",
            port.kind
        ));
        if !givers.is_empty() && port.kind != "any" {
            d.help(format!(
                "steps that give `{}`: {}",
                port.kind,
                givers.join(", ")
            ));
        } else if !port.doc.is_empty() {
            d.help(format!("{name}: {}", port.doc));
        }
    }

    /// The port that one step name alone means.
    fn only_port<'m>(
        &mut self,
        manifest: &'m Manifest,
        node: &Node,
    ) -> Option<(&'m str, &'m InputPort)> {
        let all = || manifest.inputs.iter().map(|(n, p)| (n.as_str(), p));
        let required: Vec<_> = all().filter(|(_, p)| p.required).collect();
        let ports: Vec<_> = if required.is_empty() {
            all().collect()
        } else {
            required
        };
        if let [only] = ports[..] {
            return Some(only);
        }
        let message = match ports.len() {
            0 => format!("`{}` takes no inputs", manifest.name),
            n => format!(
                "`{}` has {n} inputs; one step name does not say which",
                manifest.name
            ),
        };
        let d = self.problems.add(self.source, &node.span, message);
        d.given(node.describe());
        if !ports.is_empty() {
            let wanted: Vec<String> = ports.iter().map(|(n, _)| format!("{n}: ..")).collect();
            d.expected(format!("`from: {{{}}}`", wanted.join(", ")));
        }
        None
    }

    fn port<'m>(
        &mut self,
        manifest: &'m Manifest,
        entry: &crate::yaml::Entry,
    ) -> Option<(&'m str, &'m InputPort)> {
        let found = manifest.inputs.get_key_value(&entry.key);
        if found.is_none() {
            let message = format!("`{}` is no input of `{}`", entry.key, manifest.name);
            let d = self.problems.add(self.source, &entry.key_span, message);
            d.given(entry.key.clone())
                .suggest(&entry.key, manifest.inputs.keys().map(String::as_str));
            if manifest.inputs.is_empty() {
                d.expected("no inputs");
            }
        }
        found.map(|(n, p)| (n.as_str(), p))
    }

    /// One wire; `port` is `None` when it is not known (its step still counts for cycles).
    fn wire(&mut self, to: usize, port: Option<(&str, &InputPort)>, giver: &Node) {
        let Some(from) = self.step(giver) else { return };
        let name = port.map_or("", |(n, _)| n);
        if self
            .wires
            .iter()
            .rev()
            .take_while(|w| w.to == to)
            .any(|w| w.from == from && w.port == name && !name.is_empty())
        {
            let message = format!("`{}` is wired to `{name}` twice", self.drafts[from].name());
            self.problems
                .add(self.source, &giver.span, message)
                .help("remove one");
        }
        if let (Some((name, port)), Some(given)) = (port, kind(&self.drafts[from]))
            && !port.accepts(given)
        {
            let step = self.drafts[from].name();
            let message = format!(
                "port `{name}` takes `{}`, but step `{step}` gives `{given}`",
                port.kind
            );
            let givers: Vec<&str> = self
                .drafts
                .iter()
                .filter(|d| kind(d) == Some(port.kind.as_str()))
                .map(|d| d.name())
                .take(NAMED)
                .collect();
            let d = self.problems.add(self.source, &giver.span, message);
            d.given(format!("`{given}` from `{step}`"))
                .expected(format!("a step that gives `{}`", port.kind));
            if !givers.is_empty() {
                d.help(format!("steps that give it: {}", givers.join(", ")));
            }
        }
        self.wires.push(Wire {
            port: name.to_owned(),
            from,
            to,
            span: giver.span.clone(),
        });
    }

    /// Entries of `for_each`: name, step fanned over, place.
    fn fans(&mut self, to: usize) -> Vec<(String, usize, Span)> {
        let mut fans: Vec<(String, usize, Span)> = Vec::new();
        let Some(node) = self.drafts[to].entry.value.get("for_each") else {
            return fans;
        };
        for entry in node.entries() {
            if !is_word(&entry.key) {
                let message = format!("`{}` cannot name the items of a fan-out", entry.key);
                let d = self.problems.add(self.source, &entry.key_span, message);
                d.given(entry.key.clone()).expected(WORD);
            }
            let span = &entry.value.span;
            let Some(over) = self.step(&entry.value) else {
                continue;
            };
            let given = &self.drafts[over];
            let output = given
                .plugin
                .as_ref()
                .and_then(|p| p.manifest.output.as_ref());
            if output.is_some_and(|o| !o.collection) {
                let message = format!(
                    "step `{}` gives one artifact, not a collection",
                    given.name()
                );
                let collections: Vec<&str> = self
                    .drafts
                    .iter()
                    .filter(|d| {
                        let plugin = d.plugin.as_ref();
                        plugin
                            .and_then(|p| p.manifest.output.as_ref())
                            .is_some_and(|o| o.collection)
                    })
                    .map(|d| d.name())
                    .collect();
                let d = self.problems.add(self.source, span, message);
                d.given(given.name())
                    .expected("a step whose output is a collection");
                if !collections.is_empty() {
                    d.help(format!(
                        "steps with a collection: {}",
                        collections.join(", ")
                    ));
                }
            }
            if fans.iter().any(|f| f.1 == over) {
                let message = format!("`{}` is fanned over twice", given.name());
                self.problems
                    .add(self.source, span, message)
                    .help("remove one");
                continue;
            }
            fans.push((entry.key.clone(), over, span.clone()));
        }
        fans
    }
}

/// Kind of the artifact of a step, if its plugin is known.
fn kind<'a>(draft: &'a Draft<'_>) -> Option<&'a str> {
    draft
        .plugin
        .as_ref()?
        .manifest
        .output
        .as_ref()
        .map(|o| o.kind.as_str())
}

/// Topological order, ties in the order of the file; cycles are reported with their path.
fn order(
    drafts: &[Draft<'_>],
    edges: &[(usize, usize, Span)],
    source: &Source,
    problems: &mut Problems,
) -> Vec<usize> {
    let mut graph: DiGraph<(), ()> = DiGraph::new();
    for _ in drafts {
        graph.add_node(());
    }
    let mut known = HashSet::new();
    for (from, to, _) in edges {
        if known.insert((from, to)) {
            graph.add_edge(NodeIndex::new(*from), NodeIndex::new(*to), ());
        }
    }
    if report_cycles(&graph, drafts, edges, source, problems) {
        return Vec::new();
    }
    sorted(&graph)
}

/// Reports the steps that wait for each other, with their path; whether there are any.
fn report_cycles(
    graph: &DiGraph<(), ()>,
    drafts: &[Draft<'_>],
    edges: &[(usize, usize, Span)],
    source: &Source,
    problems: &mut Problems,
) -> bool {
    let mut cyclic = false;
    for component in petgraph::algo::tarjan_scc(graph) {
        let members: BTreeSet<usize> = component.iter().map(|n| n.index()).collect();
        let Some(&first) = members.first() else {
            continue;
        };
        if members.len() == 1 && !graph.contains_edge(NodeIndex::new(first), NodeIndex::new(first))
        {
            continue;
        }
        cyclic = true;
        let path = cycle(graph, first, &members);
        let names: Vec<&str> = path.iter().map(|&i| drafts[i].name()).collect();
        // The wire that closes the cycle into its first step of the file.
        let closing = path[path.len() - 2];
        let wire = edges
            .iter()
            .find(|(from, to, _)| *from == closing && *to == first);
        let span = wire.map_or(&drafts[first].entry.key_span, |w| &w.2);
        let d = problems.add(
            source,
            span,
            format!("steps wait for each other: {}", names.join(" -> ")),
        );
        d.given(drafts[closing].name())
            .expected("a step that does not depend on this one");
        d.help("remove one of these wires");
    }
    cyclic
}

/// The nodes of a graph without cycles in topological order, ties in the order of their numbers.
fn sorted(graph: &DiGraph<(), ()>) -> Vec<usize> {
    let mut waiting: Vec<usize> = (graph.node_indices())
        .map(|n| graph.neighbors_directed(n, petgraph::Incoming).count())
        .collect();
    let mut ready: BinaryHeap<Reverse<usize>> = (0..waiting.len())
        .filter(|&i| waiting[i] == 0)
        .map(Reverse)
        .collect();
    let mut order = Vec::with_capacity(waiting.len());
    while let Some(Reverse(i)) = ready.pop() {
        order.push(i);
        for next in graph.neighbors(NodeIndex::new(i)) {
            waiting[next.index()] -= 1;
            if waiting[next.index()] == 0 {
                ready.push(Reverse(next.index()));
            }
        }
    }
    order
}

/// A shortest cycle through `first` inside its strongly connected component, `first` at both ends.
fn cycle(graph: &DiGraph<(), ()>, first: usize, members: &BTreeSet<usize>) -> Vec<usize> {
    let mut came_from: std::collections::BTreeMap<usize, usize> = Default::default();
    let mut queue = std::collections::VecDeque::from([first]);
    while let Some(i) = queue.pop_front() {
        let mut next: Vec<usize> = graph
            .neighbors(NodeIndex::new(i))
            .map(|n| n.index())
            .collect();
        next.sort_unstable();
        for n in next.into_iter().filter(|n| members.contains(n)) {
            if n == first {
                let mut path = vec![first, i];
                let mut at = i;
                while at != first {
                    at = came_from[&at];
                    path.push(at);
                }
                path.reverse();
                // A step that waits for itself: the walk back is empty.
                return if i == first { vec![first, first] } else { path };
            }
            if let std::collections::btree_map::Entry::Vacant(e) = came_from.entry(n) {
                e.insert(i);
                queue.push_back(n);
            }
        }
    }
    vec![first, first]
}

/// Fan-out of every step: those of the collections it fans over, then its own.
fn dimensions(
    drafts: &[Draft<'_>],
    fans: &[Vec<(String, usize, Span)>],
    order: &[usize],
) -> Vec<Vec<Dimension>> {
    let mut all: Vec<Vec<Dimension>> = vec![Vec::new(); drafts.len()];
    for &i in order {
        let mut own: Vec<Dimension> = Vec::new();
        for (name, over, _) in &fans[i] {
            let over_name = drafts[*over].name();
            let inherited = all[*over].clone().into_iter();
            let new = Dimension {
                name: name.clone(),
                over: over_name.to_owned(),
            };
            for d in inherited.chain([new]) {
                if !own.iter().any(|o| o.over == d.over) {
                    own.push(d);
                }
            }
        }
        all[i] = own;
    }
    all
}

/// A port that takes one artifact cannot gather the items of a fan-out.
fn gathered(
    drafts: &[Draft<'_>],
    wires: &[Wire],
    dimensions: &[Vec<Dimension>],
    source: &Source,
    problems: &mut Problems,
) {
    for wire in wires {
        let Some(plugin) = &drafts[wire.to].plugin else {
            continue;
        };
        if plugin
            .manifest
            .inputs
            .get(&wire.port)
            .is_none_or(|p| p.many)
        {
            continue;
        }
        let mine = &dimensions[wire.to];
        let extra = dimensions[wire.from]
            .iter()
            .find(|d| !mine.iter().any(|m| m.over == d.over));
        if let Some(extra) = extra {
            let giver = drafts[wire.from].name();
            let message = format!(
                "port `{}` takes one artifact, but step `{giver}` gives one per item of `{}`",
                wire.port, extra.over
            );
            let d = problems.add(source, &wire.span, message);
            d.given(format!("all items of `{giver}`"))
                .expected("one artifact");
            d.help(format!(
                "add `for_each: {{{}: {}}}` to this step",
                extra.name, extra.over
            ));
        }
    }
}

/// The wires of one step.
fn in_order_of_ports(
    draft: &Draft<'_>,
    wires: &[Wire],
    drafts: &[Draft<'_>],
) -> Vec<ResolvedInput> {
    let Some(plugin) = &draft.plugin else {
        return Vec::new();
    };
    let ports = plugin.manifest.inputs.keys();
    ports
        .flat_map(|port| {
            wires
                .iter()
                .filter(move |w| w.port == *port)
                .map(move |w| ResolvedInput {
                    port: port.clone(),
                    from: drafts[w.from].name().to_owned(),
                })
        })
        .collect()
}
