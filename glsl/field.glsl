// Displacement fields: the tissue point P of the reference shape is at P + v(P) now, both in texture
// space. The includer declares instances[] and `vec4 fields[]`, a vector each, and
// includes shared.glsl. A field is a header (origin, nodes per mm, nodes per axis) and a displacement
// per node, x running fastest; between nodes it is trilinear, outside the nearest point's.

#include "numbers.glsl"

struct Field { vec3 origin; vec3 scale; vec3 last; uint values; float amount; };   // factor on its displacements

// Offset of the field of an instance; NONE where its tissue does not deform.
uint field_of(uint instance) {
    if (instance == NONE || (frame.flags & FLAG_WORLD_TEXTURE) != 0u) return NONE;
    return instances[instance].field;
}

// Offset of what flows in an instance, in vectors: of each generation of scatterers its weight, its number and how far it has
// been carried, then the field of the flow's shape. 0: nothing flows.
uint flow_of(uint instance) {
    if (instance == NONE || (frame.flags & FLAG_WORLD_TEXTURE) != 0u) return 0u;
    return instances[instance].flow;
}

// An includer with more than one set of fields says which is read.
#ifndef FIELD_VECTOR
#define FIELD_VECTOR(i) fields[i].xyz
#endif
vec3 field_vector(uint i) { return FIELD_VECTOR(i); }

Field load_field(uint at) {
    Field f;
    f.origin = field_vector(at);
    f.scale = field_vector(at + 1u);
    f.last = field_vector(at + 2u) - 1.0;
    f.values = at + 3u;
    f.amount = 1.0;
    return f;
}

// v at p, and its derivatives by x, y, z as columns.
vec3 displacement(Field f, vec3 p, out mat3 gradient) {
    vec3 at = (p - f.origin) * f.scale;
    vec3 on = clamp(at, vec3(0.0), f.last);
    vec3 cell = min(floor(on), f.last - 1.0);
    vec3 t = on - cell;
    uint row = uint(whole(f.last.x)) + 1u;
    uint slice = row * (uint(whole(f.last.y)) + 1u);
    uint node = f.values + uint(whole(cell.x)) + row * uint(whole(cell.y)) + slice * uint(whole(cell.z));
    vec3 a = field_vector(node), b = field_vector(node + 1u);
    vec3 c = field_vector(node + row), d = field_vector(node + row + 1u);
    vec3 e = field_vector(node + slice), g = field_vector(node + slice + 1u);
    vec3 h = field_vector(node + slice + row), i = field_vector(node + slice + row + 1u);
    vec3 near_low = a + t.x * (b - a), near_high = c + t.x * (d - c);
    vec3 far_low = e + t.x * (g - e), far_high = h + t.x * (i - h);
    vec3 near = near_low + t.y * (near_high - near_low), far = far_low + t.y * (far_high - far_low);
    vec3 along_low = (b - a) + t.y * ((d - c) - (b - a));
    vec3 along_high = (g - e) + t.y * ((i - h) - (g - e));
    vec3 slope = f.amount * f.scale * vec3(equal(at, on));
    gradient[0] = slope.x * (along_low + t.z * (along_high - along_low));
    gradient[1] = slope.y * (near_high - near_low + t.z * ((far_high - far_low) - (near_high - near_low)));
    gradient[2] = slope.z * (far - near);
    return f.amount * (near + t.z * (far - near));
}

vec3 displaced(Field f, vec3 p) {
    mat3 gradient;
    return p + displacement(f, p, gradient);
}

// Solves jacobian x = b; returns b where the field folds.
vec3 undeform(mat3 jacobian, vec3 b) {
    vec3 across = cross(jacobian[1], jacobian[2]);
    float volume = dot(jacobian[0], across);
    if (!(volume > 0.05)) return b;
    return vec3(dot(b, across), dot(jacobian[0], cross(b, jacobian[2])), dot(jacobian[0], cross(jacobian[1], b))) / volume;
}

// The reference point whose tissue is at p now: Newton's iteration, exact in one step where the
// deformation is homogeneous.
vec3 reference_point(Field f, vec3 p) {
    vec3 found = p;
    for (int i = 0; i < 6; ++i) {
        mat3 gradient;
        vec3 miss = p - found - displacement(f, found, gradient);
        found += undeform(mat3(1.0) + gradient, miss);
    }
    return found;
}

// The fields by which tissue comes from where it rests to where it is now: blood is carried by its flow first, its shape times
// a way, and then with what it is in. NONE: none.
struct Motion { uint flow; float way; uint field; };

#ifdef FLOWING_TISSUE
uint motion_offset(Motion m, uint i) { return i == 0u ? m.flow : m.field; }

Field motion_field(Motion m, uint i) {
    Field f = load_field(motion_offset(m, i));
    f.amount = i == 0u ? m.way : 1.0;
    return f;
}

// How far the tissue that rests at p has moved, and the derivative of its place by p.
vec3 moved(Motion m, vec3 p, out mat3 jacobian) {
    vec3 by = vec3(0.0);
    jacobian = mat3(1.0);
    for (uint i = 0u; i < 2u; ++i) {
        if (motion_offset(m, i) == NONE) continue;
        mat3 gradient;
        by += displacement(motion_field(m, i), p + by, gradient);
        jacobian += gradient * jacobian;
    }
    return by;
}

// Where the tissue that is at p now rests.
vec3 rest_of(Motion m, vec3 p) {
    for (uint i = 0u; i < 2u; ++i) {
        if (motion_offset(m, 1u - i) != NONE) p = reference_point(motion_field(m, 1u - i), p);
    }
    return p;
}
#else
// The same where nothing flows.
vec3 moved(Motion m, vec3 p, out mat3 jacobian) {
    vec3 by = displacement(load_field(m.field), p, jacobian);
    jacobian += mat3(1.0);
    return by;
}

vec3 rest_of(Motion m, vec3 p) { return reference_point(load_field(m.field), p); }
#endif

// The map from the world to the reference shape, for the tissue at p.
vec3 tissue_point(uint instance, vec3 p) {
    vec3 q = texture_point(instance, p);
    uint at = field_of(instance);
    return at == NONE ? q : reference_point(load_field(at), q);
}
