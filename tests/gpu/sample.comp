#version 450
// Reads a volume through a separate sampler and an image with its own, writes an image.
layout(local_size_x = 4, local_size_y = 4) in;
layout(binding = 0) uniform texture3D volume;
layout(binding = 1) uniform sampler linear;
layout(binding = 2) uniform sampler2D plane;
layout(binding = 3, r32f) uniform writeonly image2D result;

void main() {
    ivec2 at = ivec2(gl_GlobalInvocationID.xy);
    ivec2 size = imageSize(result);
    if (any(greaterThanEqual(at, size))) return;
    vec2 uv = (vec2(at) + 0.5) / vec2(size);
    float v = textureLod(sampler3D(volume, linear), vec3(uv, 0.5), 0.0).x;
    imageStore(result, at, vec4(v + textureLod(plane, uv, 0.0).x));
}
