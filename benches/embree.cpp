// Embree 3.13 beside aogauge's tracer, for `aogauge bench cpu` by the feature `embree`: one
// triangle mesh, highest build quality, not robust; one thread a call. Denormals are flushed, as
// Embree's manual asks for.
#include <embree3/rtcore.h>
#include <cstring>
#include <cmath>
#include <cstdint>
#include <xmmintrin.h>
#include <pmmintrin.h>

struct Scene { RTCDevice device; RTCScene scene; };

// Flushes denormals while it lives: the caller's rounding is its own.
struct Flushed {
    unsigned before = _mm_getcsr();
    Flushed() { _MM_SET_FLUSH_ZERO_MODE(_MM_FLUSH_ZERO_ON); _MM_SET_DENORMALS_ZERO_MODE(_MM_DENORMALS_ZERO_ON); }
    ~Flushed() { _mm_setcsr(before); }
};

extern "C" {
Scene* em_new(const float* corners, uint32_t triangles, int robust) {
    RTCDevice device = rtcNewDevice("threads=1");
    RTCScene scene = rtcNewScene(device);
    rtcSetSceneBuildQuality(scene, RTC_BUILD_QUALITY_HIGH);
    rtcSetSceneFlags(scene, robust ? RTC_SCENE_FLAG_ROBUST : RTC_SCENE_FLAG_NONE);
    RTCGeometry g = rtcNewGeometry(device, RTC_GEOMETRY_TYPE_TRIANGLE);
    float* v = (float*)rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_VERTEX, 0, RTC_FORMAT_FLOAT3, 12, triangles * 3ull);
    memcpy(v, corners, triangles * 36ull);
    uint32_t* i = (uint32_t*)rtcSetNewGeometryBuffer(g, RTC_BUFFER_TYPE_INDEX, 0, RTC_FORMAT_UINT3, 12, triangles);
    for (uint32_t k = 0; k < triangles * 3; k++) i[k] = k;
    rtcSetGeometryBuildQuality(g, RTC_BUILD_QUALITY_HIGH);
    rtcCommitGeometry(g);
    rtcAttachGeometry(scene, g);
    rtcReleaseGeometry(g);
    rtcCommitScene(scene);
    return new Scene{device, scene};
}
void em_free(Scene* s) { rtcReleaseScene(s->scene); rtcReleaseDevice(s->device); delete s; }

// points: xyz, rays a point: k (a multiple of 8), directions: point by point, in groups of eight x[8] y[8] z[8].
// out: one byte a group of eight rays, a bit a ray.
void em_occluded1(Scene* s, const float* points, uint64_t n, uint32_t k, const float* dirs, float tmax, uint8_t* out) {
    Flushed flushed;
    RTCIntersectContext c; rtcInitIntersectContext(&c);
    for (uint64_t p = 0; p < n; p++) {
        const float* o = points + 3 * p;
        for (uint32_t g = 0; g < k / 8; g++) {
            const float* d = dirs + (p * k + g * 8) * 3;
            uint8_t m = 0;
            for (int i = 0; i < 8; i++) {
                RTCRay r; r.org_x = o[0]; r.org_y = o[1]; r.org_z = o[2]; r.tnear = 0; r.dir_x = d[i]; r.dir_y = d[8 + i]; r.dir_z = d[16 + i];
                r.time = 0; r.tfar = tmax; r.mask = -1; r.id = 0; r.flags = 0;
                rtcOccluded1(s->scene, &c, &r);
                m |= (r.tfar < 0) << i;
            }
            out[p * (k / 8) + g] = m;
        }
    }
}
void em_occluded8(Scene* s, const float* points, uint64_t n, uint32_t k, const float* dirs, float tmax, uint8_t* out) {
    Flushed flushed;
    RTCIntersectContext c; rtcInitIntersectContext(&c);
    alignas(32) int valid[8] = {-1, -1, -1, -1, -1, -1, -1, -1};
    RTCRay8 r;
    for (uint64_t p = 0; p < n; p++) {
        const float* o = points + 3 * p;
        for (uint32_t g = 0; g < k / 8; g++) {
            const float* d = dirs + (p * k + g * 8) * 3;
            for (int i = 0; i < 8; i++) {
                r.org_x[i] = o[0]; r.org_y[i] = o[1]; r.org_z[i] = o[2]; r.tnear[i] = 0; r.dir_x[i] = d[i]; r.dir_y[i] = d[8 + i]; r.dir_z[i] = d[16 + i];
                r.time[i] = 0; r.tfar[i] = tmax; r.mask[i] = -1; r.id[i] = 0; r.flags[i] = 0;
            }
            rtcOccluded8(valid, s->scene, &c, &r);
            uint8_t m = 0;
            for (int i = 0; i < 8; i++) m |= (r.tfar[i] < 0) << i;
            out[p * (k / 8) + g] = m;
        }
    }
}
void em_occluded1m(Scene* s, const float* points, uint64_t n, uint32_t k, const float* dirs, float tmax, uint8_t* out, uint32_t batch) {
    Flushed flushed;
    RTCIntersectContext c; rtcInitIntersectContext(&c);
    RTCRay* r = new RTCRay[batch];
    uint64_t groups = n * (k / 8);
    for (uint64_t g0 = 0; g0 < groups; g0 += batch / 8) {
        uint64_t g1 = g0 + batch / 8 < groups ? g0 + batch / 8 : groups;
        uint32_t m = 0;
        for (uint64_t g = g0; g < g1; g++) {
            const float* o = points + 3 * (g / (k / 8));
            const float* d = dirs + g * 24;
            for (int i = 0; i < 8; i++, m++) {
                r[m].org_x = o[0]; r[m].org_y = o[1]; r[m].org_z = o[2]; r[m].tnear = 0; r[m].dir_x = d[i]; r[m].dir_y = d[8 + i]; r[m].dir_z = d[16 + i];
                r[m].time = 0; r[m].tfar = tmax; r[m].mask = -1; r[m].id = 0; r[m].flags = 0;
            }
        }
        rtcOccluded1M(s->scene, &c, r, m, sizeof(RTCRay));
        m = 0;
        for (uint64_t g = g0; g < g1; g++) { uint8_t b = 0; for (int i = 0; i < 8; i++, m++) b |= (r[m].tfar < 0) << i; out[g] = b; }
    }
    delete[] r;
}
// Closest hit, one ray at a time: the distance, or infinity.
void em_intersect1(Scene* s, const float* org, const float* dir, uint64_t n, float* t) {
    Flushed flushed;
    RTCIntersectContext c; rtcInitIntersectContext(&c);
    for (uint64_t i = 0; i < n; i++) {
        RTCRayHit h; RTCRay& r = h.ray; r.org_x = org[3*i]; r.org_y = org[3*i+1]; r.org_z = org[3*i+2]; r.tnear = 0; r.dir_x = dir[3*i]; r.dir_y = dir[3*i+1]; r.dir_z = dir[3*i+2];
        r.time = 0; r.tfar = INFINITY; r.mask = -1; r.id = 0; r.flags = 0; h.hit.geomID = RTC_INVALID_GEOMETRY_ID; h.hit.instID[0] = RTC_INVALID_GEOMETRY_ID;
        rtcIntersect1(s->scene, &c, &h);
        t[i] = h.ray.tfar;
    }
}
// Any hit with an origin and a length for each ray.
void em_occluded_free(Scene* s, const float* org, const float* dir, const float* tmax, uint64_t n, uint8_t* out) {
    Flushed flushed;
    RTCIntersectContext c; rtcInitIntersectContext(&c);
    alignas(32) int valid[8] = {-1, -1, -1, -1, -1, -1, -1, -1};
    RTCRay8 r;
    for (uint64_t g = 0; g < n / 8; g++) {
        for (int i = 0; i < 8; i++) { uint64_t k = g * 8 + i;
            r.org_x[i] = org[3*k]; r.org_y[i] = org[3*k+1]; r.org_z[i] = org[3*k+2]; r.tnear[i] = 0; r.dir_x[i] = dir[3*k]; r.dir_y[i] = dir[3*k+1]; r.dir_z[i] = dir[3*k+2];
            r.time[i] = 0; r.tfar[i] = tmax[k]; r.mask[i] = -1; r.id[i] = 0; r.flags[i] = 0; }
        rtcOccluded8(valid, s->scene, &c, &r);
        uint8_t m = 0; for (int i = 0; i < 8; i++) m |= (r.tfar[i] < 0) << i;
        out[g] = m;
    }
}
// The same one by one.
void em_occluded_free1(Scene* s, const float* org, const float* dir, const float* tmax, uint64_t n, uint8_t* out) {
    Flushed flushed;
    RTCIntersectContext c; rtcInitIntersectContext(&c);
    for (uint64_t g = 0; g < n / 8; g++) {
        uint8_t m = 0;
        for (int i = 0; i < 8; i++) { uint64_t k = g * 8 + i;
            RTCRay r; r.org_x = org[3*k]; r.org_y = org[3*k+1]; r.org_z = org[3*k+2]; r.tnear = 0; r.dir_x = dir[3*k]; r.dir_y = dir[3*k+1]; r.dir_z = dir[3*k+2];
            r.time = 0; r.tfar = tmax[k]; r.mask = -1; r.id = 0; r.flags = 0;
            rtcOccluded1(s->scene, &c, &r);
            m |= (r.tfar < 0) << i; }
        out[g] = m;
    }
}
// The same as a stream of `batch` rays.
void em_occluded_free1m(Scene* s, const float* org, const float* dir, const float* tmax, uint64_t n, uint8_t* out, uint32_t batch) {
    Flushed flushed;
    RTCIntersectContext c; rtcInitIntersectContext(&c);
    RTCRay* r = new RTCRay[batch];
    for (uint64_t at = 0; at < n; at += batch) {
        uint32_t m = n - at < batch ? n - at : batch;
        for (uint32_t i = 0; i < m; i++) { uint64_t k = at + i;
            r[i].org_x = org[3*k]; r[i].org_y = org[3*k+1]; r[i].org_z = org[3*k+2]; r[i].tnear = 0; r[i].dir_x = dir[3*k]; r[i].dir_y = dir[3*k+1]; r[i].dir_z = dir[3*k+2];
            r[i].time = 0; r[i].tfar = tmax[k]; r[i].mask = -1; r[i].id = 0; r[i].flags = 0; }
        rtcOccluded1M(s->scene, &c, r, m, sizeof(RTCRay));
        for (uint32_t i = 0; i < m; i += 8) { uint8_t b = 0; for (uint32_t j = 0; j < 8; j++) b |= (r[i + j].tfar < 0) << j; out[(at + i) / 8] = b; }
    }
    delete[] r;
}
}
