/* Training through the C interface: misuse with the status of each call, the configuration, and its memory plan.
   The training itself is tested through the command, which uses the same calls. */
#include <pthread.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>
#include <vsplat/vsplat.h>

#include "checks.h"

static const char* const micro = "{\"model\": \"micro\", \"steps\": 3}";

static void refuses(vsplat_device device) {
  const char* const nowhere[] = {"/nonexistent/objects"};
  const char* const null_path[] = {NULL};
  char* text = NULL;
  vsplat_train_options options = VSPLAT_TRAIN_OPTIONS_INIT;
  vsplat_train_plan_options plan_options = VSPLAT_TRAIN_PLAN_OPTIONS_INIT;
  vsplat_plan plan = VSPLAT_PLAN_INIT;
  vsplat_train_result result = VSPLAT_TRAIN_RESULT_INIT;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_train(device, micro, &options, &result)); /* no output */
  options.output = "/nonexistent/run";
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_train(device, micro, &options, &result)); /* no data */
  options.num_data = 1;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_train(device, micro, &options, &result));
  options.data = null_path;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_train(device, micro, &options, &result));
  options.data = nowhere;
  EXPECT(VSPLAT_ERROR_FILE, vsplat_train(device, micro, &options, &result));
  HOLD(strstr(vsplat_last_error(), nowhere[0]) != NULL);
  options.assume_selected = 1.5;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_train(device, micro, &options, &result));
  EXPECT(VSPLAT_ERROR_FORMAT, vsplat_train_plan(device, "{\"step\": 3}", NULL, &plan));
  HOLD(strstr(vsplat_last_error(), "step") != NULL);
  plan_options.selected = -0.5;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_train_plan(device, micro, &plan_options, &plan));
  plan_options.selected = 0;
  EXPECT(VSPLAT_OK, vsplat_train_plan(device, micro, &plan_options, &plan));
  HOLD(plan.fits == 1 && plan.peak > plan.host_peak && plan.host_peak > 0);
  plan_options.selection = "/nonexistent/voxels.txt";
  EXPECT(VSPLAT_ERROR_FILE, vsplat_train_plan(device, micro, &plan_options, &plan));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_train_report(nowhere, 0, "page.html"));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_train_report(null_path, 1, "page.html"));
  EXPECT(VSPLAT_ERROR_FILE, vsplat_train_report(nowhere, 1, "page.html"));
  HOLD(strstr(vsplat_last_error(), nowhere[0]) != NULL);
  EXPECT(VSPLAT_ERROR_FORMAT, vsplat_train_config("{\"steps\": true}", &text));
  HOLD(!text);
}

static void configures(void) {
  char *text = NULL, *again = NULL;
  EXPECT(VSPLAT_OK, vsplat_train_config(micro, &text));
  HOLD(text && strstr(text, "\"steps\": 3") && strstr(text, "\"weight_decay\": 0.05"));
  if (!text) return;
  EXPECT(VSPLAT_OK, vsplat_train_config(text, &again));
  HOLD(again && strcmp(text, again) == 0);
  vsplat_text_free(text);
  vsplat_text_free(again);
}

static void plans(vsplat_device device) {
  vsplat_train_plan_options options = VSPLAT_TRAIN_PLAN_OPTIONS_INIT;
  vsplat_plan usual = VSPLAT_PLAN_INIT, more = VSPLAT_PLAN_INIT, bound = VSPLAT_PLAN_INIT, drawn = VSPLAT_PLAN_INIT;
  EXPECT(VSPLAT_OK, vsplat_train_plan(device, micro, NULL, &usual));
  HOLD(usual.fits == 1 && usual.peak > 100000 && usual.peak <= usual.limit && usual.num_stages > 5);
  options.selected = 0.75;
  EXPECT(VSPLAT_OK, vsplat_train_plan(device, micro, &options, &more));
  HOLD(more.peak > usual.peak);
  options.intersections = 100000000; /* the largest possible number */
  EXPECT(VSPLAT_OK, vsplat_train_plan(device, micro, &options, &drawn));
  options.bound = 1;
  EXPECT(VSPLAT_OK, vsplat_train_plan(device, micro, &options, &bound));
  HOLD(bound.peak >= more.peak && bound.peak >= drawn.peak);
}

static void tells_what_does_not_fit(void) {
  vsplat_device device = NULL;
  vsplat_device_options options = VSPLAT_DEVICE_OPTIONS_INIT;
  vsplat_plan plan = VSPLAT_PLAN_INIT;
  int i;
  for (i = 0; i < 2; ++i) { /* of about 100 KiB, and less than the largest weights take */
    options.max_memory_gib = i ? 0.00004 : 0.0001;
    EXPECT(VSPLAT_OK, vsplat_device_open(&options, &device));
    EXPECT(VSPLAT_OK, vsplat_train_plan(device, micro, NULL, &plan));
    HOLD(plan.fits == 0 && plan.peak > plan.limit);
    vsplat_device_release(device);
  }
}

/* Requests the stop again while a training writes its state, like a user who sees no reaction. */
typedef struct stopping {
  vsplat_device device;
  volatile int begun, ended;
} stopping;

static int32_t a_step(void* user) {
  ((stopping*)user)->begun = 1;
  return 1;
}

static void* stops(void* user) {
  stopping* s = user;
  while (!s->begun) usleep(1000);
  while (!s->ended) {
    EXPECT(VSPLAT_OK, vsplat_device_cancel(s->device));
    usleep(100);
  }
  return NULL;
}

static void keeps_its_checkpoint(vsplat_device device) {
  static const char* const endless =
      "{\"model\": \"micro\", \"steps\": 100000, \"procedural\": 1, \"batch\": 1, \"checkpoint_every\": 0, "
      "\"sheet_every\": 0}";
  static const char* const words = "its checkpoint is ";
  char run[] = "/tmp/vsplat-train-XXXXXX", command[128];
  vsplat_train_options options = VSPLAT_TRAIN_OPTIONS_INIT;
  vsplat_train_result result = VSPLAT_TRAIN_RESULT_INIT;
  stopping s = {NULL, 0, 0};
  const char* path;
  pthread_t thread;
  s.device = device;
  HOLD(mkdtemp(run) != NULL);
  options.output = run;
  options.go_on = a_step;
  options.user = &s;
  HOLD(pthread_create(&thread, NULL, stops, &s) == 0);
  EXPECT(VSPLAT_ERROR_CANCELLED, vsplat_train(device, endless, &options, &result));
  s.ended = s.begun = 1;
  HOLD(pthread_join(thread, NULL) == 0);
  path = strstr(vsplat_last_error(), words);
  HOLD(path != NULL && access(path + strlen(words), R_OK) == 0);
  snprintf(command, sizeof command, "rm -r %s", run);
  HOLD(system(command) == 0);
}

int main(void) {
  vsplat_device device = NULL;
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  refuses(device);
  configures();
  plans(device);
  tells_what_does_not_fit();
  keeps_its_checkpoint(device);
  vsplat_device_release(device);
  if (failures) printf("%d checks do not hold\n", failures);
  return failures != 0;
}
