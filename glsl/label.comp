// variants: bvh query(RAY_QUERY)
#version 460
// Labels of the samples: what the scan plane has there; and where the middle of the beam is when the sample's echo is
// made, what it has lost up to there, which surface it meets, and how the tissue there has moved. One work group is one
// scanline, in the middle of the slice.
#extension GL_GOOGLE_include_directive : require
#extension GL_EXT_control_flow_attributes : require
#ifdef RAY_QUERY
#extension GL_EXT_ray_query : require
#endif
#include "shared.glsl"
#include "random.glsl"

layout(local_size_x = 64) in;

layout(std430, binding = 0) restrict readonly buffer FrameBuffer { Frame frame; };
layout(std430, binding = 1) restrict readonly buffer TissueBuffer { Tissue tissues[]; };
layout(std430, binding = 2) restrict readonly buffer InstanceBuffer { Instance instances[]; };
layout(std430, binding = 3) restrict readonly buffer VertexBuffer { float vertices[]; };
layout(std430, binding = 4) restrict readonly buffer NormalBuffer { float normals[]; };
layout(std430, binding = 5) restrict readonly buffer SmoothedBuffer { uvec4 smoothed[]; };
layout(std430, binding = 6) restrict readonly buffer TriangleBuffer { uint triangles[]; };
#ifdef RAY_QUERY
layout(binding = 7) uniform accelerationStructureEXT tlas;
#else
layout(std430, binding = 7) restrict readonly buffer NodeBuffer { uvec4 nodes[]; };
#endif
layout(std430, binding = 8) restrict buffer CounterBuffer { Counters counters; };
layout(std430, binding = 9) restrict readonly buffer ScanlineBuffer { Scanline scanlines[]; };
layout(std430, binding = 10) restrict readonly buffer RowBuffer { Row rows[]; };
layout(std430, binding = 11) restrict readonly buffer ContactBuffer { float contact[]; };
layout(std430, binding = 12) restrict readonly buffer FieldBuffer { vec4 fields[]; };
// As they were in the last frame.
layout(std430, binding = 13) restrict readonly buffer FrameBeforeBuffer { Frame frame_before; };
layout(std430, binding = 14) restrict readonly buffer InstancesBeforeBuffer { Instance instances_before[]; };
layout(std430, binding = 15) restrict readonly buffer FieldsBeforeBuffer { vec4 fields_before[]; };
layout(std430, binding = 16) restrict buffer LabelBuffer { Label labels[]; };
layout(std430, binding = 17) restrict readonly buffer ApertureBuffer { Aperture apertures[]; };

#include "triangle.glsl"
#ifdef RAY_QUERY
#define RAY_MASK frame.ray_mask
#define RAY_SLOTS ((frame.flags & FLAG_SLOTS) != 0u)
#include "intersect_query.glsl"
#else
#include "intersect_bvh.glsl"
#endif
#include "surface.glsl"
#include "probe.glsl"
#include "transform.glsl"
#include "acoustics.glsl"
#include "footprint.glsl"
#include "media.glsl"
#include "path.glsl"
#include "wavefront.glsl"
#include "aperture.glsl"
#include "crossings.glsl"
#include "transmitted.glsl"
#include "contact.glsl"

// True while the last frame's fields are read.
bool past = false;
#define FIELD_VECTOR(i) (past ? fields_before[i].xyz : fields[i].xyz)
#include "field.glsl"

const float NO_SURFACE = -1.0;
const float DECIBEL_PER_NEPER = 8.685889638;
const float DEGREES = 57.29577951;
const uint MAX_WAYS = 64u;

// The instance around the scanline up to each crossing, and behind the last.
shared uint around[MAX_CROSSINGS + 1u];
// The ways of the main path.
shared uint way_count;
shared float way_begin[MAX_WAYS];        // sample
shared uint way_instance[MAX_WAYS];
shared uint way_tissue[MAX_WAYS];        // NONE: the path has ended, or is not heard
shared vec4 way_origin[MAX_WAYS];        // world; nepers of amplitude lost up to there
shared vec4 way_direction[MAX_WAYS];     // mm per sample; nepers lost per sample
shared float way_incidence[MAX_WAYS];    // degrees, on the surface at which it begins, or NO_SURFACE

float incidence = NO_SURFACE;

bool is_over(Path path) {
    return way_count + 1u == MAX_WAYS || path.interactions >= frame.max_interactions
        || (!loses_by_aperture() && path.weight < frame.min_weight);
}

void begin_way(Path path, uint instance, Medium way, bool heard, bool ends) {
    uint i = way_count;
    bool seen = heard && !ends;
    float per_sample = way.speed * frame.sample_pitch / frame.speed;
    way_begin[i] = frame.speed * path.time / frame.sample_pitch;
    way_instance[i] = instance;
    way_tissue[i] = seen ? tissue_of(instance) : NONE;
    way_origin[i] = vec4(path.origin, -log(max(path.weight, 1e-37)));
    way_direction[i] = vec4(path.direction * per_sample, way.absorption * per_sample);
    way_incidence[i] = incidence;
    incidence = NO_SURFACE;
    way_count = i + 1u;
}

void pass_way(float t) {}

void pass_surface(Path path, vec3 normal, float transmitted) {
    incidence = DEGREES * arc(length(cross(path.direction, normal)), -dot(path.direction, normal));
}

void end_ways() {}

// The media around the scanline's start: what it leaves more often than it enters; what it leaves last is outermost.
void media_at_start(inout Media media) {
    media.count = 0u;
    for (uint i = crossing_count; i > 0u; --i) {
        uint instance = crossed[i - 1u], entered;
        bool known = crossings[i - 1u] > 0.0;
        for (uint j = 0u; j < media.count; ++j) known = known || media.ids[j] == instance;
        if (known || media.count == MAX_STACK || !is_around(instance, 0u, entered)) continue;
        media.ids[media.count] = instance;
        media.count += 1u;
    }
    if (media.count == 0u && frame.couplant != NONE) {
        media.ids[0] = frame.couplant;
        media.count = 1u;
    }
}

// Where the tissue of an instance that is at p in the world was in the last frame.
vec3 place_before(uint instance, vec3 p) {
    if (instance == NONE) return p;
    vec3 q = apply_point(instances[instance].texture_from_world, p);
    uint now = field_of(instance), then = instances_before[instance].field;
    // Without a field then, the reference shape was shown.
    if (now != NONE) q = reference_point(load_field(now), q);
    if (now != NONE && then != NONE) {
        past = true;
        q = displaced(load_field(then), q);
        past = false;
    }
    // Rigid: its inverse is its transpose.
    vec4 a = instances_before[instance].texture_from_world[0];
    vec4 b = instances_before[instance].texture_from_world[1];
    vec4 c = instances_before[instance].texture_from_world[2];
    return (q.x - a.w) * a.xyz + (q.y - b.w) * b.xyz + (q.z - c.w) * c.xyz;
}

// Factor on amplitudes by the aperture, in nepers, of the layers beside the middle of the slice.
float beside_middle(uint l, float time, float lost) {
    uint low = (frame.layers - 1u) / 2u, high = frame.layers / 2u;
    return 0.5 * (aperture_nepers(low * frame.scanlines + l, time, lost) + aperture_nepers(high * frame.scanlines + l, time, lost));
}

void main() {
    uint line = gl_WorkGroupID.x;
    if (gl_LocalInvocationID.x == 0u) {
        vec3 o, d, lateral;
        probe_ray(line, 0u, o, d, lateral);
        o.y = 0.0;
        follow_scanline(world_point(o), world_vector(d));
        for (uint i = 0u; i <= crossing_count; ++i) around[i] = instance_behind(i);
        Path path;
        Media media;
        begin(world_point(o), world_vector(d), world_vector(lateral), path);
        media_at_start(media);
        way_count = 0u;
        follow(path, media);
    }
    barrier();
    for (uint k = gl_LocalInvocationID.x; k < frame.samples; k += 64u) {
        float depth = float(k) * frame.sample_pitch;
        uint passed = 0u;
        while (passed < crossing_count && abs(crossings[passed]) <= depth) ++passed;
        uint at = line * frame.samples + k;
        uint there = around[passed];
        labels[at].true_instance = there;
        if (there == NONE && passed == 0u) there = frame.couplant;
        labels[at].true_tissue = tissue_of(there);

        uint way = 0u;
        while (way + 1u < way_count && way_begin[way + 1u] <= float(k)) ++way;
        float here = float(k) - way_begin[way];
        float lost = way_origin[way].w + here * way_direction[way].w;
        if (loses_by_aperture()) lost -= beside_middle(line, depth / frame.speed, lost);
        bool seen = way_tissue[way] != NONE && !(loses_by_aperture() && lost > -log(frame.min_weight));
        uint instance = seen && way_instance[way] != frame.couplant ? way_instance[way] : NONE;
        vec3 place = way_origin[way].xyz + here * way_direction[way].xyz;
        float loss = DECIBEL_PER_NEPER * lost;
        vec3 moved = probe_point(place) - apply_point(frame_before.probe_from_world, place_before(instance, place));
        float met = NO_SURFACE;
        for (uint i = way_count; i > 1u; --i) {
            bool nearest = floor(way_begin[i - 1u] + 0.5) == float(k) && way_incidence[i - 1u] >= 0.0;
            met = mix(met, way_incidence[i - 1u], nearest);
        }
        labels[at].tissue = seen ? way_tissue[way] : NONE;
        labels[at].instance = instance;
        labels[at].place_loss = mix(vec4(0.0), vec4(probe_point(place), loss), bvec4(seen));
        labels[at].moved_incidence = vec4(mix(vec3(0.0), moved, bvec3(seen)), met);
        labels[at].contact = coupling(line, rows[k].receive_reach);
    }
}
