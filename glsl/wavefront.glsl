// Refraction of a beam's wavefront at a surface: by the mean slope over the wavefront's width.
//
// The includer declares frame, rows[], instances[], vertices[], normals[], triangles[] and smoothed[], and includes
// surface.glsl and path.glsl.

#include "octahedron.glsl"

// Normals of a surface where a path meets it: of length 1, with the sign for which the triangle's is against the path.
struct Slope {
    vec3 geometric;     // of the triangle
    vec3 shading;       // interpolated from the vertices
    vec3 refracting;    // of the mean slope over the wavefront; in geometric acoustics that of `shading`
    vec3 turning;       // change of `refracting` per mm across the path, in the image plane
    vec3 ray;           // of the mean slope over what one of the aperture's rays stands for, where it is asked for
    float width;        // deviation of the sine of incidence over the beam
};

// Normals of the triangle's corners, with their coherence, as the vertices have them averaged over x times the finest
// scale of their averages; between two scales they are mixed, below the finest with the vertices' own.
void average(inout vec4 n[3], vec3 own[3], uvec4 averages[3], float x) {
    uint level = uint(x >= 1.0) + uint(x >= 2.0) + uint(x >= 4.0);
    float below = mix(0.0, float(1u << level) * 0.5, level > 0u);
    float share = min((x - below) / max(below, 1.0), 1.0);
    [[dont_unroll]] for (uint i = 0u; i < 3u; ++i) {
        vec4 coarse = unpack_mean(averages[i][level]);
        vec4 fine = mix(unpack_mean(averages[i][max(level, 1u) - 1u]), vec4(own[i], 1.0), bvec4(level == 0u));
        n[i] = mix(fine, coarse, share);
    }
}

// Mean slope, as a normal, of what a wavefront along d meets where the surface's normals average to n with a coherence
// below 1: the area reaches around a rim. What faces d less what is turned away is the mean's part along d. As much of
// the wavefront as is turned away passes the body by, and keeps its direction.
vec3 partly_turned(vec3 n, float coherence, vec3 d) {
    float facing = -dot(n, d);
    vec3 across = coherence * (n + facing * d);
    float whole = sqrt(max(1.0 - dot(across, across), 1e-6));
    float met = max(whole + coherence * facing, 0.0) / 2.0;
    return normalize(met * across - whole * whole * d);
}

// The way along a surface of normal n from where a path meets it to where a parallel one does, 1 mm beside it.
vec3 across_surface(vec3 direction, vec3 lateral, vec3 n) {
    return lateral + dot(lateral, n) / max(-dot(direction, n), LEAST_FACING) * direction;
}

// `row` is that of the path's time; `spread` the variance that the path has across, mm^2. `rays`: also for a ray alone.
Slope slope_at(Met here, Path path, uint row, float spread, bool rays) {
    Hit hit = here.hit;
    Slope slope;
    slope.geometric = here.normal;
    slope.shading = surface_shading_normal(hit);
    float side = mix(1.0, -1.0, dot(path.direction, here.normal) >= 0.0);
    slope.geometric *= side;
    slope.shading *= side;
    bool turned = !(dot(path.direction, slope.shading) < 0.0);
    slope.shading = mix(slope.shading, slope.geometric, bvec3(turned));

    vec3 own[3];
    vec4 n[3];
    uvec4 averages[3];
    [[dont_unroll]] for (uint i = 0u; i < 3u; ++i) {
        uint vertex = triangles[3u * hit.primitive + i];
        averages[i] = smoothed[vertex];
        own[i] = vec3(normals[3u * vertex], normals[3u * vertex + 1u], normals[3u * vertex + 2u]);
        n[i] = vec4(own[i], 1.0);
    }
    slope.refracting = slope.shading;
    slope.ray = slope.shading;
    bool wide = (frame.flags & FLAG_WAVEFRONT) != 0u;
    float coherence = 1.0;
    if (wide) {
        float finest = instances[hit.instance].finest;
        float sigma = rows[row].sigma_wavefront;
        float x = sqrt(sigma * sigma + spread) / finest;
        // What the wavefront covers of the surface is longer the more it is inclined, which the first turn tells. A turn
        // before them is for a ray.
        float inclined = mix(1.0, max(-dot(path.direction, slope.shading), LEAST_FACING), rays);
        [[dont_unroll]] for (uint i = rays ? 0u : 1u; i < 3u; ++i) {
            average(n, own, averages, mix(x, max(rows[row].sigma_lateral, RAY_WIDTH * sigma) / finest, i == 0u) / inclined);
            vec4 mean = (1.0 - hit.u - hit.v) * n[0] + hit.u * n[1] + hit.v * n[2];
            vec3 normal = side * surface_to_world(hit.instance, mean.xyz);
            coherence = mean.w;
            if (i == 0u) slope.ray = partly_turned(normal, coherence, path.direction);
            slope.refracting = normal;
            inclined = mix(max(-dot(path.direction, normal), LEAST_FACING), 1.0, i == 0u);
        }
        // Rounding alone makes less than 1 of coherences that are 1 at all corners.
        vec3 turned = partly_turned(slope.refracting, coherence, path.direction);
        slope.refracting = mix(turned, slope.refracting, bvec3(coherence > 0.99999));
    }

    vec3 corners[3] = { n[0].xyz, n[1].xyz, n[2].xyz };
    slope.turning = side * coherence * surface_turning(hit, across_surface(path.direction, path.lateral, slope.refracting), corners);
    slope.width = 0.0;
    if ((frame.flags & FLAG_FOOTPRINT) != 0u) {
        float lateral = rows[row].sigma_lateral;
        float cos_i = -dot(path.direction, slope.refracting);
        // In the plane of incidence; at normal incidence along the image.
        vec3 along = path.direction + cos_i * slope.refracting + 0.01 * path.lateral;
        float curved = surface_curvature(hit, along, corners) * sqrt(lateral * lateral + spread);
        // The slope that was averaged away, as roughness.
        float rough = dot(normalize(along), slope.shading - slope.refracting);
        slope.width = sqrt(curved * curved + rough * rough);
    }
    return slope;
}

// Mean reflectance at a slope between two media.
float reflectance_at(Slope slope, vec3 direction, Medium t1, Medium t2) {
    float cos_i = max(-dot(direction, slope.refracting), 0.0);
    return footprint_reflectance(t1.impedance, t1.speed, t2.impedance, t2.speed, cos_i, slope.width);
}

// Refracts a path at normal n into the next medium. False at total reflection; the path is then as it was.
bool transmit_path(inout Path path, vec3 n, vec3 n_geometric, float c1, float c2) {
    vec3 d = path.direction;
    if ((frame.flags & FLAG_WAVEFRONT) != 0u) {
        // Seen from behind, as a facet at the side of a bump may be, nothing is refracted.
        if (dot(d, n) < 0.0 && !refraction(path.direction, n, c1, c2, d)) return false;
        // A path that would leave through the triangle again runs along it.
        float rise = dot(d, n_geometric) + LEAST_DESCENT;
        d = normalize(d - max(rise, 0.0) * n_geometric);
    } else if (!refraction(path.direction, n, c1, c2, d) || dot(d, n_geometric) >= 0.0) {
        if (!refraction(path.direction, n_geometric, c1, c2, d)) return false;
    }
    path.lateral = normalize(path.lateral - dot(path.lateral, d) * d);
    path.direction = d;
    return true;
}

// The neighbouring scanline's path behind a surface of normal n, which turns by `turning` per mm across: it meets the
// surface's plane beside this path, and is refracted there. Takes its distance across in front of the surface, mm, with
// the growth per mm; returns the same behind it, where the path's lateral axis is `beside`. At total reflection, which
// only a part of the beam passes, both go on as they came.
vec2 strip_behind(vec2 strip, vec3 direction, vec3 lateral, vec3 beside, vec3 n, vec3 turning, float c1, float c2) {
    float across = dot(across_surface(direction, lateral, n), beside);
    // So near to it that both go through, so far that rounding does not matter.
    float part = min(BENDING_STEP / max(abs(strip.x), LEAST_PITCH), BENDING_ANGLE / max(abs(strip.y), LEAST_PITCH));
    vec3 middle, aside;
    bool through = dot(direction, n) < 0.0 && refraction(direction, n, c1, c2, middle)
        && refraction(normalize(direction + part * strip.y * lateral), normalize(n + part * strip.x * turning), c1, c2, aside);
    return vec2(strip.x * across, mix(strip.y, dot(aside - middle, beside) / part, through));
}

// Sine by which a surface of normal n turns a ray towards the path's lateral axis; 0 at total reflection.
float ray_bending(vec3 direction, vec3 lateral, vec3 n, float c1, float c2) {
    vec3 behind;
    bool through = dot(direction, n) < 0.0 && refraction(direction, n, c1, c2, behind);
    return mix(0.0, dot(behind, lateral), through);
}

// Curvature that a surface of normal n, which turns by `turning` per mm across, gives to the wavefront of a path: change
// of the refracted direction per mm across, rad.
float bending(vec3 direction, vec3 lateral, vec3 n, vec3 turning, float c1, float c2) {
    vec3 middle, beside;
    bool through = turning != vec3(0.0) && refraction(direction, n, c1, c2, middle)
        && refraction(direction, normalize(n + BENDING_STEP * turning), c1, c2, beside);
    return mix(0.0, dot(beside - middle, lateral) / BENDING_STEP, through);
}
