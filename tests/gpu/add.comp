#version 450
// target[i] = factor * source[i] + value; the group size and the factor are specialized.
layout(local_size_x_id = 0, local_size_y = 1, local_size_z = 1) in;
layout(constant_id = 1) const uint FACTOR = 1;

layout(std430, binding = 0) readonly buffer SourceBuffer { uint source[]; };
layout(std430, binding = 1) buffer TargetBuffer { uint target[]; };
layout(push_constant) uniform Push { uint count; uint value; };

void main() {
    uint i = gl_GlobalInvocationID.x;
    if (i < count) target[i] = FACTOR * source[i] + value;
}
