/* A device used by several threads at once, by a callback, and by a child of fork(), in plain C. Each call either
   works or fails with an error. Prints every check that fails; exits 1 if any did. */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>
#include <vsplat/vsplat.h>

enum { side = 48, pixels = side * side, count = 300, threads = 8, calls = 20 };

#include "ball_scene.h"

static vsplat_status draw(vsplat_device device, vsplat_scene scene, const vsplat_render_options* options, float* out) {
  vsplat_camera camera = VSPLAT_CAMERA_INIT;
  vsplat_picture picture = VSPLAT_PICTURE_INIT;
  camera.width = camera.height = side;
  camera.fx = camera.fy = 100;
  camera.cx = camera.cy = side / 2.0;
  picture.capacity = pixels;
  picture.colour = out;
  return vsplat_render(device, scene, &camera, options, &picture);
}

typedef struct work {
  vsplat_device device; /* NULL: each opens its own */
  vsplat_scene scene;
  const float* want;
  int drawn, busy, other, wrong;
} work;

static void* draws_again_and_again(void* user) {
  work* w = user;
  vsplat_device device = w->device;
  float* got = malloc(3 * pixels * sizeof(float));
  int i;
  if (!device && vsplat_device_open(NULL, &device) != VSPLAT_OK) ++w->other;
  for (i = 0; device && i < calls; ++i) {
    const vsplat_status status = draw(device, w->scene, NULL, got);
    if (status == VSPLAT_OK) {
      ++w->drawn;
      w->wrong += memcmp(got, w->want, 3 * pixels * sizeof(float)) != 0;
    } else if (status == VSPLAT_ERROR_BUSY && strstr(vsplat_last_error(), "in use by another call")) {
      ++w->busy;
    } else {
      ++w->other;
    }
  }
  if (!w->device) vsplat_device_release(device);
  free(got);
  return NULL;
}

/* Runs 8 threads; with `device` NULL each opens its own. */
static work at_once(vsplat_device device, vsplat_scene scene, const float* want) {
  pthread_t ids[threads];
  work all[threads], sum;
  int i;
  memset(&sum, 0, sizeof sum);
  for (i = 0; i < threads; ++i) {
    all[i] = sum;
    all[i].device = device, all[i].scene = scene, all[i].want = want;
  }
  for (i = 0; i < threads; ++i) HOLD(pthread_create(&ids[i], NULL, draws_again_and_again, &all[i]) == 0);
  for (i = 0; i < threads; ++i) {
    HOLD(pthread_join(ids[i], NULL) == 0);
    sum.drawn += all[i].drawn, sum.busy += all[i].busy, sum.other += all[i].other, sum.wrong += all[i].wrong;
  }
  return sum;
}

typedef struct again {
  vsplat_device device;
  vsplat_scene scene;
  vsplat_status status;
  vsplat_status of_views;
  int asked;
} again;

static int32_t draws_meanwhile(void* user, const char* stage, double done) {
  again* a = user;
  float out[3 * pixels];
  (void)stage, (void)done;
  a->status = draw(a->device, a->scene, NULL, out);
  a->of_views = vsplat_render_views(a->device, a->scene, NULL, 0, NULL, NULL);
  ++a->asked;
  return 1;
}

static void a_callback_finds_it_busy(vsplat_device device, vsplat_scene scene, const float* want) {
  vsplat_render_options options = VSPLAT_RENDER_OPTIONS_INIT;
  again a;
  float got[3 * pixels];
  a.device = device, a.scene = scene, a.status = a.of_views = VSPLAT_OK, a.asked = 0;
  options.progress = draws_meanwhile;
  options.user = &a;
  EXPECT(VSPLAT_OK, draw(device, scene, &options, got));
  HOLD(a.asked > 0 && a.status == VSPLAT_ERROR_BUSY && a.of_views == VSPLAT_ERROR_BUSY);
  HOLD(memcmp(got, want, sizeof got) == 0);
}

static void a_child_is_refused(vsplat_device device, vsplat_scene scene) {
  int status = -1;
  const pid_t child = fork();
  if (child == 0) {
    float out[3 * pixels];
    vsplat_device other = NULL;
    size_t n = 0;
    failures = 0;
    alarm(20); /* it must not hang */
    EXPECT(VSPLAT_ERROR_DEVICE, draw(device, scene, NULL, out));
    HOLD(strstr(vsplat_last_error(), "forked") != NULL);
    EXPECT(VSPLAT_ERROR_DEVICE, vsplat_device_open(NULL, &other));
    EXPECT(VSPLAT_ERROR_DEVICE, vsplat_device_count(&n));
    vsplat_scene_release(scene);
    vsplat_device_release(device);
    fflush(stdout);
    _exit(failures == 0 ? 0 : 1);
  }
  HOLD(child > 0 && waitpid(child, &status, 0) == child && WIFEXITED(status) && WEXITSTATUS(status) == 0);
}

int main(void) {
  static float want[3 * pixels];
  vsplat_device device = NULL;
  vsplat_scene scene = make_scene(3);
  work w;
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  EXPECT(VSPLAT_OK, draw(device, scene, NULL, want));
  HOLD(want[3 * (pixels / 2 + side / 2)] != want[0]); /* the picture is not empty */
  w = at_once(device, scene, want);
  HOLD(w.other == 0 && w.wrong == 0 && w.drawn > 0 && w.busy > 0 && w.drawn + w.busy == threads * calls);
  w = at_once(NULL, scene, want);
  HOLD(w.other == 0 && w.wrong == 0 && w.drawn == threads * calls);
  a_callback_finds_it_busy(device, scene, want);
  a_child_is_refused(device, scene);
  EXPECT(VSPLAT_OK, draw(device, scene, NULL, want));
  vsplat_scene_release(scene);
  vsplat_device_release(device);
  return failures == 0 ? 0 : 1;
}
