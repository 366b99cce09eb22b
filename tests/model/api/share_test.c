/* Work distributed over devices: every item once and in order, whichever device fails, and nothing done twice. */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

#include "micro_input.h"

enum { ITEMS = 24, DEVICES = 3 };

static vsplat_device open_with(double gib) {
  vsplat_device_options options = VSPLAT_DEVICE_OPTIONS_INIT;
  vsplat_device out = NULL;
  options.max_memory_gib = gib;
  EXPECT(VSPLAT_OK, vsplat_device_open(&options, &out));
  return out;
}

struct work {
  vsplat_device devices[DEVICES];
  vsplat_model model;
  vsplat_input input;
  vsplat_scene scenes[ITEMS];
  size_t delivered, lost_index, lost_item, losses;
  size_t bad_item; /* fails with `bad` on any device; ITEMS: none */
  vsplat_status bad;
  int device_gone;   /* devices[1] fails from item 4 on */
  size_t stop_after; /* on_done ends the work there; ITEMS: never */
  pthread_mutex_t mutex;
  int failed_call; /* bad_item fails through a call of the library */
};

static vsplat_status do_item(void* user, vsplat_device device, size_t index, size_t item) {
  struct work* w = user;
  vsplat_reconstruct_options options = some_voxels();
  HOLD(index < DEVICES && w->devices[index] == device);
  if (w->device_gone && index == 1 && item >= 4) return VSPLAT_ERROR_DEVICE;
  if (item == w->bad_item) return w->failed_call ? vsplat_scene_load("/nowhere.ply", NULL) : w->bad;
  HOLD(w->scenes[item] == NULL);
  return vsplat_reconstruct(device, w->model, w->input, &options, &w->scenes[item]);
}

static vsplat_status is_done(void* user, size_t item) {
  struct work* w = user;
  HOLD(item == w->delivered && w->scenes[item] != NULL);
  ++w->delivered;
  return item == w->stop_after ? VSPLAT_ERROR_CANCELLED : VSPLAT_OK;
}

static void is_lost(void* user, size_t index, size_t item, const char* error) {
  struct work* w = user;
  pthread_mutex_lock(&w->mutex);
  ++w->losses;
  w->lost_index = index;
  w->lost_item = item;
  HOLD(strlen(error) > 0);
  pthread_mutex_unlock(&w->mutex);
}

static vsplat_status run(struct work* w, size_t devices) {
  vsplat_share_options options = VSPLAT_SHARE_OPTIONS_INIT;
  size_t i;
  options.on_done = is_done;
  options.on_lost = is_lost;
  options.user = w;
  for (i = 0; i < ITEMS; ++i) {
    vsplat_scene_release(w->scenes[i]);
    w->scenes[i] = NULL;
  }
  w->delivered = w->losses = 0;
  return vsplat_share_out(w->devices, devices, ITEMS, do_item, &options);
}

static void test_all_are_done(struct work* w, vsplat_scene wanted) {
  size_t devices, i;
  for (devices = 1; devices <= DEVICES; ++devices) {
    EXPECT(VSPLAT_OK, run(w, devices));
    HOLD(w->delivered == ITEMS && w->losses == 0);
    for (i = 0; i < ITEMS; ++i) HOLD(are_equal(w->scenes[i], wanted));
  }
}

static void test_others_go_on(struct work* w, vsplat_scene wanted) {
  size_t i;
  w->device_gone = 1;
  EXPECT(VSPLAT_OK, run(w, DEVICES));
  HOLD(w->delivered == ITEMS && w->losses <= 1); /* no loss if the device got no item */
  if (w->losses) HOLD(w->lost_index == 1 && w->lost_item >= 4);
  for (i = 0; i < ITEMS; ++i) HOLD(are_equal(w->scenes[i], wanted));
  w->device_gone = 0;
  w->bad_item = 7, w->bad = VSPLAT_ERROR_DEVICE; /* fails on every device */
  EXPECT(VSPLAT_ERROR_DEVICE, run(w, DEVICES));
  HOLD(w->losses == DEVICES - 1 && w->delivered <= 7);
  w->bad_item = ITEMS;
}

static void test_what_ends_it(struct work* w) {
  w->bad_item = 5, w->bad = VSPLAT_ERROR_INPUT;
  EXPECT(VSPLAT_ERROR_INPUT, run(w, DEVICES));
  HOLD(w->delivered == 5 && w->losses == 0);
  w->failed_call = 1;
  EXPECT(VSPLAT_ERROR_USAGE, run(w, DEVICES)); /* status and message of the failed call */
  HOLD(strstr(vsplat_last_error(), "out_scene") != NULL);
  w->failed_call = 0;
  w->bad = (vsplat_status)77;
  EXPECT(VSPLAT_ERROR_USAGE, run(w, DEVICES));
  HOLD(strstr(vsplat_last_error(), "77") != NULL);
  w->bad_item = ITEMS;
  w->stop_after = 3;
  EXPECT(VSPLAT_ERROR_CANCELLED, run(w, DEVICES));
  HOLD(w->delivered == 4);
  w->stop_after = ITEMS;
}

static void test_refusals(struct work* w) {
  vsplat_device two[2];
  vsplat_share_options options = VSPLAT_SHARE_OPTIONS_INIT;
  two[0] = two[1] = w->devices[0];
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_share_out(w->devices, 0, 1, do_item, NULL));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_share_out(two, 2, 1, do_item, NULL));
  two[1] = NULL;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_share_out(two, 2, 1, do_item, NULL));
  options.size = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_share_out(w->devices, 1, 1, do_item, &options));
  EXPECT(VSPLAT_OK, vsplat_share_out(w->devices, DEVICES, 0, do_item, NULL));
}

int main(void) {
  struct work w;
  vsplat_reconstruct_options options = some_voxels();
  vsplat_scene wanted = NULL;
  size_t i;
  memset(&w, 0, sizeof w);
  pthread_mutex_init(&w.mutex, NULL);
  w.bad_item = w.stop_after = ITEMS;
  w.devices[0] = open_with(0);
  EXPECT(VSPLAT_OK, vsplat_stream_create(w.devices[0], &w.devices[1]));
  w.devices[2] = open_with(0); /* one of its own */
  w.model = make_model("micro", 1);
  w.input = make_input(w.model, 16);
  EXPECT(VSPLAT_OK, vsplat_reconstruct(w.devices[0], w.model, w.input, &options, &wanted));
  test_all_are_done(&w, wanted);
  test_others_go_on(&w, wanted);
  test_what_ends_it(&w);
  test_refusals(&w);
  for (i = 0; i < ITEMS; ++i) vsplat_scene_release(w.scenes[i]);
  vsplat_scene_release(wanted);
  vsplat_input_release(w.input);
  vsplat_model_release(w.model);
  for (i = 0; i < DEVICES; ++i) vsplat_device_release(w.devices[i]);
  pthread_mutex_destroy(&w.mutex);
  if (failures == 0) printf("ok\n");
  return failures != 0;
}
