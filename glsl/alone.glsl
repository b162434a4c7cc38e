// Samples of a scanline that are heard: those of the frame; where one line is made alone, those over which
// `beam` smooths it.
// Part of scatter.comp; all threads of a work group take part.

#include "smooth.glsl"

shared int first_heard;
shared int last_heard;

// By one thread, before a barrier.
void begin_heard() {
    bool alone = (frame.flags & FLAG_LINE) != 0u;
    first_heard = int(alone ? frame.samples : frame.first_sample);
    last_heard = alone ? -1 : int(frame.end_sample);
}

// By all threads, between two barriers.
void find_heard(uint scanline, uint thread, uint threads) {
    if ((frame.flags & FLAG_LINE) == 0u) return;
    int beside = abs(int(scanline) - int(frame.image_left));
    for (uint k = thread; k < frame.samples; k += threads) {
        if (reach_of(rows[k].strip_lines, LATERAL_REACH) >= beside) {
            atomicMin(first_heard, int(k));
            atomicMax(last_heard, int(k));
        }
    }
}
