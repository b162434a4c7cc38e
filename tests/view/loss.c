// A Vulkan layer that loses the device: when the file named by INSONIFY_TEST_LOSS exists, the next
// submission removes it and fails with ERROR_DEVICE_LOST, and so does all that waits, until another
// device is made. The real device is left idle, so that it may be destroyed as a lost one may.
//
// Declarations as in vulkan_core.h and vk_layer.h (Apache-2.0, The Khronos Group), of what is needed.
#include <stdint.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

typedef int32_t Result;
typedef void (*Function)(void);
typedef Function (*GetProcAddr)(void *, const char *);

enum { SUCCESS = 0, INITIALIZATION_FAILED = -3, DEVICE_LOST = -4 };
enum { LOADER_INSTANCE_CREATE_INFO = 47, LOADER_DEVICE_CREATE_INFO = 48, LINK_INFO = 0 };

typedef struct Base { int32_t type; const struct Base *next; } Base;

typedef struct InstanceLink {
    struct InstanceLink *next;
    GetProcAddr instance_proc;
    GetProcAddr physical_device_proc;
} InstanceLink;

typedef struct DeviceLink {
    struct DeviceLink *next;
    GetProcAddr instance_proc;
    GetProcAddr device_proc;
} DeviceLink;

typedef struct { int32_t type; const void *next; int32_t function; InstanceLink *link; } InstanceInfo;
typedef struct { int32_t type; const void *next; int32_t function; DeviceLink *link; } DeviceInfo;

typedef struct {
    int32_t type;
    void *next;
    uint32_t version;
    GetProcAddr instance_proc;
    GetProcAddr device_proc;
    GetProcAddr physical_device_proc;
} Negotiation;

static GetProcAddr next_instance_proc, next_device_proc;
static void *instance, *device;
static volatile int lost;

static const Base *found(const Base *info, int32_t type) {
    for (info = info->next; info; info = info->next) {
        if (info->type == type && ((const InstanceInfo *)info)->function == LINK_INFO) return info;
    }
    return NULL;
}

static Result create_instance(const Base *info, const void *allocator, void **out) {
    InstanceInfo *chain = (InstanceInfo *)found(info, LOADER_INSTANCE_CREATE_INFO);
    if (!chain) return INITIALIZATION_FAILED;
    next_instance_proc = chain->link->instance_proc;
    chain->link = chain->link->next;
    Result (*create)(const Base *, const void *, void **) = (void *)next_instance_proc(NULL, "vkCreateInstance");
    Result result = create(info, allocator, out);
    if (result == SUCCESS) instance = *out;
    return result;
}

static Result create_device(void *physical, const Base *info, const void *allocator, void **out) {
    DeviceInfo *chain = (DeviceInfo *)found(info, LOADER_DEVICE_CREATE_INFO);
    if (!chain) return INITIALIZATION_FAILED;
    next_device_proc = chain->link->device_proc;
    GetProcAddr instance_proc = chain->link->instance_proc;
    chain->link = chain->link->next;
    Result (*create)(void *, const Base *, const void *, void **) =
        (void *)instance_proc(instance, "vkCreateDevice");
    Result result = create(physical, info, allocator, out);
    if (result == SUCCESS) {
        device = *out;
        lost = 0;
    }
    return result;
}

static int is_lost(void) {
    const char *file = getenv("INSONIFY_TEST_LOSS");
    if (!lost && file && unlink(file) == 0) {
        Result (*idle)(void *) = (void *)next_device_proc(device, "vkDeviceWaitIdle");
        idle(device);
        lost = 1;
    }
    return lost;
}

#define NEXT(name) ((void *)next_device_proc(device, name))

static Result submit(void *queue, uint32_t count, const void *submits, uint64_t fence) {
    if (is_lost()) return DEVICE_LOST;
    Result (*next)(void *, uint32_t, const void *, uint64_t) = NEXT("vkQueueSubmit");
    return next(queue, count, submits, fence);
}

static Result wait_fences(void *of, uint32_t count, const uint64_t *fences, uint32_t all, uint64_t time) {
    if (lost) return DEVICE_LOST;
    Result (*next)(void *, uint32_t, const uint64_t *, uint32_t, uint64_t) = NEXT("vkWaitForFences");
    return next(of, count, fences, all, time);
}

static Result queue_idle(void *queue) {
    if (lost) return DEVICE_LOST;
    Result (*next)(void *) = NEXT("vkQueueWaitIdle");
    return next(queue);
}

static Result device_idle(void *of) {
    Result (*next)(void *) = NEXT("vkDeviceWaitIdle");
    Result result = next(of);
    return lost ? DEVICE_LOST : result;
}

static Result acquire(void *of, uint64_t chain, uint64_t time, uint64_t semaphore, uint64_t fence, uint32_t *image) {
    if (lost) return DEVICE_LOST;
    Result (*next)(void *, uint64_t, uint64_t, uint64_t, uint64_t, uint32_t *) = NEXT("vkAcquireNextImageKHR");
    return next(of, chain, time, semaphore, fence, image);
}

static Result present(void *queue, const void *info) {
    if (lost) return DEVICE_LOST;
    Result (*next)(void *, const void *) = NEXT("vkQueuePresentKHR");
    return next(queue, info);
}

static Function instance_proc(void *of, const char *name);
static Function device_proc(void *of, const char *name);

static const struct { const char *name; Function function; int of_instance; } OURS[] = {
    {"vkGetInstanceProcAddr", (Function)instance_proc, 1},
    {"vkCreateInstance", (Function)create_instance, 1},
    {"vkCreateDevice", (Function)create_device, 1},
    {"vkGetDeviceProcAddr", (Function)device_proc, 0},
    {"vkQueueSubmit", (Function)submit, 0},
    {"vkWaitForFences", (Function)wait_fences, 0},
    {"vkQueueWaitIdle", (Function)queue_idle, 0},
    {"vkDeviceWaitIdle", (Function)device_idle, 0},
    {"vkAcquireNextImageKHR", (Function)acquire, 0},
    {"vkQueuePresentKHR", (Function)present, 0},
};

static Function ours(const char *name, int of_instance) {
    for (size_t i = 0; i < sizeof OURS / sizeof OURS[0]; ++i) {
        if (OURS[i].of_instance <= of_instance && !strcmp(OURS[i].name, name)) return OURS[i].function;
    }
    return NULL;
}

static Function instance_proc(void *of, const char *name) {
    Function function = ours(name, 1);
    return function ? function : next_instance_proc(of, name);
}

static Function device_proc(void *of, const char *name) {
    Function function = ours(name, 0);
    return function ? function : next_device_proc(of, name);
}

Result vkNegotiateLoaderLayerInterfaceVersion(Negotiation *negotiation) {
    negotiation->version = 2;
    negotiation->instance_proc = instance_proc;
    negotiation->device_proc = device_proc;
    negotiation->physical_device_proc = NULL;
    return SUCCESS;
}
