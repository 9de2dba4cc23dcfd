//! Strongly connected components of a graph.

use std::collections::BTreeMap;

/// Who uses whom, by name.
pub(crate) type Graph = BTreeMap<String, Vec<String>>;

/// Groups of two and more nodes each of which reaches all others of its group; groups and nodes in the order of names.
///
/// Tarjan 1972, "Depth-first search and linear graph algorithms".
pub(crate) fn components(graph: &Graph) -> Vec<Vec<String>> {
    let mut search = Search { graph, order: BTreeMap::new(), stack: Vec::new(), found: Vec::new() };
    for node in graph.keys() {
        if !search.order.contains_key(node.as_str()) {
            search.visit(node);
        }
    }
    search.found.sort();
    search.found
}

struct Search<'a> {
    graph: &'a Graph,
    /// When a node was met; the largest number once its component is complete.
    order: BTreeMap<&'a str, usize>,
    stack: Vec<&'a str>,
    found: Vec<Vec<String>>,
}

impl<'a> Search<'a> {
    /// Visits a node and returns the earliest one on the stack that it reaches.
    fn visit(&mut self, node: &'a str) -> usize {
        let number = self.order.len();
        self.order.insert(node, number);
        let place = self.stack.len();
        self.stack.push(node);
        let mut earliest = number;
        for next in self.graph.get(node).into_iter().flatten() {
            let reached = match self.order.get(next.as_str()) {
                Some(&number) => number,
                None => self.visit(next),
            };
            earliest = earliest.min(reached);
        }
        if earliest == number {
            let mut component: Vec<String> =
                self.stack.split_off(place).into_iter().map(str::to_owned).collect();
            for node in &component {
                *self.order.get_mut(node.as_str()).expect("it was met") = usize::MAX;
            }
            if component.len() > 1 {
                component.sort();
                self.found.push(component);
            }
            return usize::MAX;
        }
        earliest
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn graph(edges: &[(&str, &str)]) -> Graph {
        let mut graph = Graph::new();
        for (from, to) in edges {
            graph.entry((*from).to_owned()).or_default().push((*to).to_owned());
        }
        graph
    }

    #[test]
    fn a_tree_has_none() {
        assert!(components(&graph(&[("a", "b"), ("a", "c"), ("b", "c"), ("c", "d")])).is_empty());
    }

    #[test]
    fn two_circles_are_two_groups() {
        let found =
            components(&graph(&[("a", "b"), ("b", "a"), ("b", "c"), ("c", "d"), ("d", "e"), ("e", "c")]));
        assert_eq!(found, [vec!["a", "b"], vec!["c", "d", "e"]]);
    }

    #[test]
    fn circles_that_touch_are_one() {
        let found = components(&graph(&[("a", "b"), ("b", "a"), ("b", "c"), ("c", "b")]));
        assert_eq!(found, [vec!["a", "b", "c"]]);
    }
}
