/* A caller's own fit loop with pictures in memory, in plain C: step, stop, take the scene. Prints every
   check that fails; exits 1 if any did. */
#include <math.h>
#include <pthread.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "fit_setting.h"

static void refuses(vsplat_device device, vsplat_views from, vsplat_scene start) {
  const char* nobody = "nobody";
  vsplat_scene discs = make_shapes(1, 1);
  vsplat_fit none = NULL;
  vsplat_fit_options o = make_options(start);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(NULL, from, &o, &none));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, NULL, &o, &none));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, from, NULL, &none));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, from, &o, NULL));
  o.scene = NULL;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, from, &o, &none));
  o = make_options(start);
  o.start = VSPLAT_FIT_NETWORK; /* without a model */
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, from, &o, &none));
  o = make_options(start);
  o.start = VSPLAT_FIT_POINTS; /* not available for pictures in memory */
  EXPECT(VSPLAT_ERROR_FILE, vsplat_fit_create(device, from, &o, &none));
  o = make_options(start);
  o.names = &nobody, o.num_names = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, from, &o, &none));
  HOLD(strstr(vsplat_last_error(), "vsplat_fit_options.names nobody"));
  o = make_options(start);
  o.holdout_count = views;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, from, &o, &none));
  o = make_options(start);
  o.steps = -1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, from, &o, &none));
  o = make_options(start);
  o.seconds = NAN;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, from, &o, &none));
  o = make_options(start);
  o.freeze = 64;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, from, &o, &none));
  o = make_options(start);
  o.sh_degree = 4;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, from, &o, &none));
  o = make_options(discs);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_create(device, from, &o, &none));
  HOLD(strstr(vsplat_last_error(), "surfels") != NULL);
  vsplat_scene_release(discs);
  HOLD(!none);
}

static void a_loop_of_ones_own(vsplat_device device, vsplat_views from, vsplat_scene start) {
  const vsplat_fit_options o = make_options(start);
  vsplat_fit_progress progress = VSPLAT_FIT_PROGRESS_INIT;
  vsplat_fit_result result = VSPLAT_FIT_RESULT_INIT;
  vsplat_fit fit = NULL;
  vsplat_scene scene = NULL, kept = NULL;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  float got[3 * pixels], means[3 * count];
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  vsplat_camera camera = VSPLAT_CAMERA_INIT;
  double first = 0;
  int32_t more = 1, held_out = -1, steps = 0;
  size_t n = 0;
  EXPECT(VSPLAT_OK, vsplat_fit_create(device, from, &o, &fit));
  while (more) {
    EXPECT(VSPLAT_OK, vsplat_fit_step(fit, &progress, &more));
    if (++steps == 1) first = progress.loss;
    HOLD(strcmp(progress.phase, "fitting") == 0 && progress.step == steps && progress.steps == 200);
  }
  HOLD(steps == 200);
  HOLD(progress.loss < first);
  EXPECT(VSPLAT_OK, vsplat_fit_step(fit, NULL, &more)); /* no step is left */
  HOLD(more == 0);
  EXPECT(VSPLAT_OK, vsplat_fit_get_result(fit, &result));
  HOLD(result.returned == 0 && result.num_held_out == 1 && result.claimed == 0);
  HOLD(result.in_turn == 0 && result.background[0] == 1 && result.background[2] == 1);
  HOLD(result.result_psnr > result.start_psnr + 3);
  EXPECT(VSPLAT_OK, vsplat_fit_get_views(fit, VSPLAT_FIT_USED, NULL, 0, &n));
  HOLD(n == views);
  EXPECT(VSPLAT_OK, vsplat_fit_get_views(fit, VSPLAT_FIT_HELD_OUT, &held_out, 1, &n));
  HOLD(n == 1 && held_out >= 0 && held_out < views);
  EXPECT(VSPLAT_OK, vsplat_fit_get_view(fit, (size_t)held_out, &camera, got, 3 * pixels));
  HOLD(camera.width == side && fabs(camera.fx - 30) < 1e-9);
  HOLD(fabs(camera.w2c[11] - 2) < 1e-9);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_get_view(fit, views, &camera, NULL, 0));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_get_view(fit, 0, NULL, got, 3 * pixels - 1));
  EXPECT(VSPLAT_OK, vsplat_fit_get_start(fit, &kept));
  EXPECT(VSPLAT_OK, vsplat_fit_get_scene(fit, &scene));
  vsplat_fit_release(fit);
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(kept, &info)); /* both outlive it */
  HOLD(info.count == count);
  EXPECT(VSPLAT_OK, vsplat_scene_get_info(scene, &info));
  HOLD(info.count > 0 && info.count <= count && fabs(info.near_plane - 0.1) < 1e-6);
  arrays.capacity = count;
  arrays.means = means;
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &arrays));
  HOLD(fabs(means[0]) < 1);
  vsplat_scene_release(scene);
  vsplat_scene_release(kept);
}

typedef struct sums {
  double psnr, psnr_cc;
  int pictures, most;
} sums;

static int32_t add_up(void* user, const vsplat_measured* m) {
  sums* s = user;
  float largest = 0;
  int i;
  HOLD(m->width == side && m->height == side && m->view >= 0 && m->view < views);
  for (i = 0; i < 3 * pixels; ++i) largest = fmaxf(largest, fabsf(m->drawn[i] - m->given[i]));
  HOLD(largest > 0 && m->psnr > 0 && m->psnr_cc >= m->psnr - 1e-9 && isnan(m->lpips_alex));
  s->psnr += m->psnr, s->psnr_cc += m->psnr_cc;
  return ++s->pictures < s->most;
}

/* A scene on some pictures, and on all of them. */
static void measured_on_pictures(vsplat_device device, vsplat_views from, vsplat_scene start) {
  const int32_t wanted[] = {4, 1}, wrong[] = {views};
  vsplat_camera cameras[2];
  vsplat_measure_options o = VSPLAT_MEASURE_OPTIONS_INIT;
  vsplat_measured mean = VSPLAT_MEASURED_INIT, moved = VSPLAT_MEASURED_INIT;
  vsplat_scene truth = make_scene(1);
  sums s = {0, 0, 0, views + 1};
  o.on_picture = add_up, o.user = &s;
  EXPECT(VSPLAT_OK, vsplat_scene_measure(device, start, from, &o, &mean));
  HOLD(s.pictures == views && fabs(mean.psnr - s.psnr / views) < 1e-9 && fabs(mean.psnr_cc - s.psnr_cc / views) < 1e-9);
  HOLD(mean.view == -1 && mean.width == 0 && !mean.drawn && mean.ssim < 1);
  s.pictures = 0, s.most = 2;
  EXPECT(VSPLAT_ERROR_CANCELLED, vsplat_scene_measure(device, start, from, &o, &moved));
  HOLD(s.pictures == 2);
  o.on_picture = NULL;
  o.views = wanted, o.num_views = 2;
  EXPECT(VSPLAT_OK, vsplat_scene_measure(device, truth, from, &o, &mean));
  HOLD(mean.psnr > 55 && mean.ssim > 0.999); /* pictures of this scene, on white */
  cameras[0] = make_camera(4), cameras[1] = make_camera(1);
  cameras[0].w2c[11] += 0.1, cameras[1].w2c[11] += 0.1;
  o.cameras = cameras;
  EXPECT(VSPLAT_OK, vsplat_scene_measure(device, truth, from, &o, &moved));
  HOLD(moved.psnr < 40);
  cameras[1].width = side + 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_measure(device, truth, from, &o, &moved));
  o.cameras = NULL;
  o.background[0] = o.background[1] = o.background[2] = 0; /* behind the scene alone: the pictures are opaque */
  EXPECT(VSPLAT_OK, vsplat_scene_measure(device, truth, from, &o, &moved));
  HOLD(moved.psnr < 10);
  o.longest = 12;
  EXPECT(VSPLAT_OK, vsplat_scene_measure(device, truth, from, &o, &moved));
  o.masks = (vsplat_masks)7;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_measure(device, truth, from, &o, &moved));
  o.masks = VSPLAT_MASKS_IGNORE; /* there is none */
  EXPECT(VSPLAT_OK, vsplat_scene_measure(device, truth, from, &o, &moved));
  o.views = wrong, o.num_views = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_scene_measure(device, truth, from, &o, &moved));
  HOLD(strstr(vsplat_last_error(), "options.views[0]") != NULL);
  vsplat_scene_release(truth);
}

static void settings(vsplat_device device, vsplat_views from, vsplat_scene start) {
  vsplat_fit_options o = make_options(start);
  vsplat_fit fit = NULL;
  char* text = NULL;
  vsplat_plan plan = VSPLAT_PLAN_INIT;
  vsplat_fit_result result = VSPLAT_FIT_RESULT_INIT;
  int32_t more = 1;
  o.seed = 7, o.longest = 0, o.freeze = VSPLAT_FREEZE_MEANS | VSPLAT_FREEZE_SH;
  EXPECT(VSPLAT_OK, vsplat_fit_create(device, from, &o, &fit));
  EXPECT(VSPLAT_OK, vsplat_fit_get_settings(fit, &text));
  HOLD(text && strstr(text, "\"steps\":200,") && strstr(text, "\"seed\":7,") && strstr(text, "\"size\":\"full\"") &&
       strstr(text, "\"freeze\":\"means,sh\"") && strstr(text, "\"quality\":\"draft\"") &&
       strstr(text, "\"strategy\":\"mcmc\"") && strstr(text, "\"background\":\"auto\"") &&
       strstr(text, "\"derived\":{\"extent\":\"object\",") != NULL);
  vsplat_text_free(text);
  EXPECT(VSPLAT_OK, vsplat_fit_get_plan(fit, &plan));
  EXPECT(VSPLAT_OK, vsplat_fit_step(fit, NULL, &more));
  EXPECT(VSPLAT_OK, vsplat_fit_get_result(fit, &result));
  HOLD(plan.fits == 1 && plan.host_peak > 0 && plan.peak > 0 && plan.peak < 3 * result.peak);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_fit_get_plan(NULL, &plan));
  vsplat_fit_release(fit);
}

typedef struct impatience {
  vsplat_device device;
  volatile int done;
} impatience;

static void* stops_again_and_again(void* user) {
  impatience* i = user;
  while (!i->done) {
    usleep(1500);
    EXPECT(VSPLAT_OK, vsplat_device_cancel(i->device));
  }
  return NULL;
}

/* The means after a fit that rotates its held-out views, and how many of its steps were stopped. */
static int fitted(vsplat_device device, vsplat_views from, vsplat_scene start, int impatient, float* means) {
  vsplat_fit_options o = make_options(start);
  vsplat_fit fit = NULL;
  vsplat_scene scene = NULL;
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  impatience other = {NULL, 0};
  pthread_t id;
  int32_t more = 1;
  int stopped = 0;
  o.holdout = VSPLAT_HOLDOUT_AUTO;
  o.steps = 30;
  EXPECT(VSPLAT_OK, vsplat_fit_create(device, from, &o, &fit));
  other.device = device;
  if (impatient) HOLD(pthread_create(&id, NULL, stops_again_and_again, &other) == 0);
  while (more) {
    const vsplat_status status = vsplat_fit_step(fit, NULL, &more);
    if (status == VSPLAT_ERROR_CANCELLED)
      ++stopped;
    else
      EXPECT(VSPLAT_OK, status);
  }
  other.done = 1;
  if (impatient) HOLD(pthread_join(id, NULL) == 0);
  EXPECT(VSPLAT_OK, vsplat_fit_get_scene(fit, &scene));
  vsplat_fit_release(fit);
  arrays.capacity = count;
  arrays.means = means;
  EXPECT(VSPLAT_OK, vsplat_scene_get_gaussians(scene, &arrays));
  vsplat_scene_release(scene);
  return stopped;
}

/* Wherever a step is stopped, the next call continues as if it had not been. */
static void stopped_by_another_thread_it_goes_on(vsplat_device device, vsplat_views from, vsplat_scene start) {
  float want[3 * count], got[3 * count];
  memset(want, 0, sizeof want);
  memset(got, 0, sizeof got);
  HOLD(fitted(device, from, start, 0, want) == 0 && want[0] != 0);
  HOLD(fitted(device, from, start, 1, got) > 2); /* as often as the other thread is scheduled */
  HOLD(memcmp(want, got, sizeof want) == 0);
}

static void stopped_it_gives_the_best_so_far(vsplat_device device, vsplat_views from, vsplat_scene start) {
  vsplat_fit_options o = make_options(start);
  vsplat_fit fit = NULL;
  vsplat_fit_result result = VSPLAT_FIT_RESULT_INIT;
  vsplat_scene scene = NULL;
  int32_t more = 1;
  o.steps = 1000;
  o.holdout = VSPLAT_HOLDOUT_NONE;
  EXPECT(VSPLAT_OK, vsplat_fit_create(device, from, &o, &fit));
  EXPECT(VSPLAT_OK, vsplat_fit_step(fit, NULL, &more));
  EXPECT(VSPLAT_OK, vsplat_fit_step(fit, NULL, &more));
  HOLD(more == 1);
  EXPECT(VSPLAT_OK, vsplat_fit_stop(fit));
  EXPECT(VSPLAT_OK, vsplat_fit_step(fit, NULL, &more));
  HOLD(more == 0);
  EXPECT(VSPLAT_OK, vsplat_fit_get_result(fit, &result));
  HOLD(result.steps == 2 && result.returned == 0 && result.num_held_out == 0 && isnan(result.result_psnr));
  EXPECT(VSPLAT_OK, vsplat_fit_get_scene(fit, &scene));
  vsplat_scene_release(scene);
  vsplat_fit_retain(fit);
  vsplat_fit_release(fit);
  vsplat_fit_release(fit);
}

static void a_plan_grows_with_the_scene(vsplat_device device) {
  vsplat_device fresh = open_device();
  vsplat_plan small = VSPLAT_PLAN_INIT, large = VSPLAT_PLAN_INIT;
  EXPECT(VSPLAT_OK, vsplat_plan_fit(device, 1000, 1, side, side, &small));
  EXPECT(VSPLAT_OK, vsplat_plan_fit(device, 100000, 1, side, side, &large));
  HOLD(small.fits == 1 && large.peak > 10 * small.peak);
  HOLD(small.host_peak > 0 && large.host_peak > 50 * small.host_peak);
  /* SSIM's maps are counted: with them a step holds 15 pictures, without them at most 11. A first slab is counted
     once. */
  EXPECT(VSPLAT_OK, vsplat_plan_fit(fresh, 100, 1, 512, 512, &small));
  vsplat_device_release(fresh);
  HOLD(small.peak > 12.0 * 512 * 512 * 3 * sizeof(float) && small.peak < 18.0 * 512 * 512 * 3 * sizeof(float));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_plan_fit(device, 0, 1, side, side, &small));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_plan_fit(device, 1, 4, side, side, &small));
}

int main(void) {
  vsplat_device device = open_device();
  vsplat_views from = make_views(device);
  vsplat_scene start = make_scene(0);
  char* name = NULL;
  EXPECT(VSPLAT_OK, vsplat_views_get_name(from, 3, &name));
  HOLD(strcmp(name, "3") == 0);
  vsplat_text_free(name);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_views_get_name(from, views, &name));
  refuses(device, from, start);
  a_loop_of_ones_own(device, from, start);
  measured_on_pictures(device, from, start);
  settings(device, from, start);
  stopped_by_another_thread_it_goes_on(device, from, start);
  stopped_it_gives_the_best_so_far(device, from, start);
  a_plan_grows_with_the_scene(device);
  vsplat_scene_release(start);
  vsplat_views_release(from);
  vsplat_device_release(device);
  return failures == 0 ? 0 : 1;
}
