// Adds the steps of this invocation's traversals to the frame's counters;
// does nothing unless built with COUNT.
void report_counts() {
#ifdef COUNT
    atomicAdd(counters.node_visits, bvh_node_visits);
    atomicAdd(counters.triangle_tests, bvh_triangle_tests);
    atomicAdd(counters.top_visits, bvh_top_visits);
    atomicAdd(counters.instances_reached, bvh_instances_reached);
    atomicAdd(counters.false_unions, bvh_false_unions);
    atomicAdd(counters.false_boxes, bvh_false_boxes);
#endif
}
