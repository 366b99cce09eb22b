/* Streams of a device, jobs and cancellation, in plain C. Prints every check that fails; exits 1 if any did. */
#include <pthread.h>
#include <time.h>
#include <unistd.h>

#include "micro_input.h"

enum { edge = 16, streams = 4, repeats = 5 };

static double now(void) {
  struct timespec t;
  clock_gettime(CLOCK_MONOTONIC, &t);
  return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void pause_for(double seconds) { usleep((unsigned)(1e6 * seconds)); }

/* Time limit that only detects a hang; waiting that long under a sanitizer or on a busy machine is no failure. */
static double patience(void) {
  const char* times = getenv("VSPLAT_PATIENCE");
  return 5.0 * (times ? atof(times) : 1);
}

/* ------------------------------------------------------------------------------------------------------- streams */

typedef struct work {
  vsplat_device stream;
  vsplat_model models[2];
  vsplat_input input;
  vsplat_scene want[2];
  int equal, failed;
} work;

/* Uses both models alternately, so that both are on the device at once. */
static void* reconstructs(void* user) {
  work* w = user;
  const vsplat_reconstruct_options options = some_voxels();
  int i;
  for (i = 0; i < 2 * repeats; ++i) {
    vsplat_scene made = NULL;
    if (vsplat_reconstruct(w->stream, w->models[i % 2], w->input, &options, &made) != VSPLAT_OK) {
      ++w->failed;
      continue;
    }
    w->equal += are_equal(made, w->want[i % 2]);
    vsplat_scene_release(made);
  }
  return NULL;
}

static void streams_at_once(vsplat_device device, vsplat_model model, vsplat_model other, vsplat_input input) {
  const vsplat_reconstruct_options options = some_voxels();
  pthread_t ids[streams];
  work all[streams];
  vsplat_scene want[2] = {NULL, NULL};
  int i;
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, model, input, &options, &want[0]));
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, other, input, &options, &want[1]));
  HOLD(!are_equal(want[0], want[1]));
  EXPECT(VSPLAT_OK, vsplat_device_trim(device)); /* the streams upload the models, and later ones share them */
  for (i = 0; i < streams; ++i) {
    memset(&all[i], 0, sizeof all[i]);
    EXPECT(VSPLAT_OK, vsplat_stream_create(i ? all[i - 1].stream : device, &all[i].stream));
    all[i].models[0] = model, all[i].models[1] = other, all[i].input = input;
    all[i].want[0] = want[0], all[i].want[1] = want[1];
  }
  for (i = 0; i < streams; ++i) HOLD(pthread_create(&ids[i], NULL, reconstructs, &all[i]) == 0);
  for (i = 0; i < streams; ++i) {
    HOLD(pthread_join(ids[i], NULL) == 0);
    HOLD(all[i].failed == 0 && all[i].equal == 2 * repeats);
  }
  for (i = 0; i < streams; ++i) vsplat_device_release(all[i].stream);
  vsplat_scene_release(want[0]);
  vsplat_scene_release(want[1]);
}

static int compiled = 0;
static void counts(void* user, const char* kernel, int32_t before) {
  (void)user, (void)kernel, (void)before;
  ++compiled;
}

/* Set in one thread, read in another. */
static void set(int* flag) { __atomic_store_n(flag, 1, __ATOMIC_RELEASE); }
static int is_set(int* flag) { return __atomic_load_n(flag, __ATOMIC_ACQUIRE); }

static int32_t hears(void* user, const char* stage, double done) {
  double* last = user;
  if (!stage || done < *last || done > 1) *last = 2; /* no larger value is ever reported */
  if (*last <= 1) *last = done;
  return 1;
}

/* Afterwards nothing remains to be compiled. Runs on a stream of the device, which outlives the device. */
static void prepares(vsplat_model made, vsplat_input input) {
  vsplat_device_options device_options = VSPLAT_DEVICE_OPTIONS_INIT;
  vsplat_prepare_options options = VSPLAT_PREPARE_OPTIONS_INIT;
  const vsplat_reconstruct_options voxels = some_voxels();
  vsplat_device device = NULL, stream = NULL;
  vsplat_model model = NULL;
  vsplat_scene scene = NULL;
  double last = 0;
  int before;
  EXPECT(VSPLAT_OK, vsplat_model_with_passes(made, 1, 0, 2, &model));
  device_options.on_compile = counts;
  EXPECT(VSPLAT_OK, vsplat_device_open(&device_options, &device));
  options.views = 17;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_device_prepare(device, model, &options));
  options.views = 2;
  options.progress = hears;
  options.user = &last;
  EXPECT(VSPLAT_OK, vsplat_device_prepare(device, model, &options));
  HOLD(last > 0.9 && last <= 1);
  before = compiled;
  EXPECT(VSPLAT_OK, vsplat_stream_create(device, &stream));
  vsplat_device_release(device);
  EXPECT(VSPLAT_OK, vsplat_reconstruct(stream, model, input, &voxels, &scene));
  HOLD(compiled == before);
  vsplat_scene_release(scene);
  last = 0;
  options.launch = 1;
  EXPECT(VSPLAT_OK, vsplat_device_prepare(stream, model, &options));
  HOLD(last > 0.7 && last <= 1);
  vsplat_device_release(stream);
  vsplat_model_release(model);
}

/* The programs of jobs; valid and invalid requests. */
static void lists_programs(vsplat_model model) {
  const vsplat_device_options device_options = VSPLAT_DEVICE_OPTIONS_INIT;
  vsplat_programs_options options = VSPLAT_PROGRAMS_OPTIONS_INIT;
  vsplat_device device = NULL;
  char* text = NULL;
  EXPECT(VSPLAT_OK, vsplat_device_open(&device_options, &device));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_device_programs(device, NULL, NULL, &text));
  options.jobs = 16;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_device_programs(device, model, &options, &text));
  HOLD(text == NULL);
  options.jobs = VSPLAT_PROGRAMS_OF_RENDER;
  options.others = 0;
  EXPECT(VSPLAT_OK, vsplat_device_programs(device, NULL, &options, &text)); /* needs no model */
  HOLD(strstr(text, "\"project_forward\"") && !strstr(text, "\"gemm_") && !strstr(text, "kernel void"));
  vsplat_text_free(text);
  options.jobs = VSPLAT_PROGRAMS_OF_RECONSTRUCT;
  options.sources = 1;
  EXPECT(VSPLAT_OK, vsplat_device_programs(device, model, &options, &text));
  HOLD(strstr(text, "\"gemm_") && strstr(text, "kernel void") && !strstr(text, "\"adamw_step\""));
  vsplat_text_free(text);
  vsplat_device_release(device);
}

/* ---------------------------------------------------------------------------------------------------------- jobs */

typedef struct ended {
  int calls;
  vsplat_status waited; /* status of waiting for another job of the device */
  vsplat_job other;
  vsplat_device device;
  vsplat_model model;
  vsplat_input input;
  vsplat_job next; /* started from the callback */
} ended;

static void has_ended(void* user, vsplat_job job) {
  ended* e = user;
  vsplat_job_state state = VSPLAT_JOB_QUEUED;
  EXPECT(VSPLAT_OK, vsplat_job_wait(job, -1, &state)); /* it is complete, even here */
  HOLD(state == VSPLAT_JOB_DONE);
  if (e->other) e->waited = vsplat_job_wait(e->other, -1, &state);
  if (e->device) {
    const vsplat_reconstruct_options options = some_voxels();
    EXPECT(VSPLAT_OK, vsplat_reconstruct_async(e->device, e->model, e->input, &options, NULL, &e->next));
  }
  pause_for(0.05);
  set(&e->calls);
}

static void jobs_give_what_calls_give(vsplat_device device, vsplat_model model, vsplat_input input) {
  vsplat_reconstruct_options options = some_voxels();
  vsplat_job_options on_end = VSPLAT_JOB_OPTIONS_INIT;
  vsplat_scene want = NULL, got = NULL;
  vsplat_job first = NULL, second = NULL;
  vsplat_job_state state = VSPLAT_JOB_QUEUED;
  ended e;
  memset(&e, 0, sizeof e);
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, model, input, &options, &want));
  on_end.on_end = has_ended;
  on_end.user = &e;
  e.device = device, e.model = model, e.input = input;
  EXPECT(VSPLAT_OK, vsplat_reconstruct_async(device, model, input, &options, &on_end, &first));
  EXPECT(VSPLAT_OK, vsplat_job_wait(first, patience(), &state));
  HOLD(state == VSPLAT_JOB_DONE);
  EXPECT(VSPLAT_OK, vsplat_job_result(first, &got));
  HOLD(got && are_equal(got, want));
  vsplat_scene_release(got);
  HOLD(is_set(&e.calls)); /* the caller may reuse its data */
  EXPECT(VSPLAT_OK, vsplat_job_wait(e.next, patience(), &state));
  HOLD(state == VSPLAT_JOB_DONE);
  got = NULL;
  EXPECT(VSPLAT_OK, vsplat_job_result(e.next, &got));
  HOLD(got && are_equal(got, want));
  vsplat_scene_release(got);
  vsplat_job_release(e.next);
  vsplat_job_release(first);

  /* A failing job gives the same message as the call. */
  options.near_plane = -1;
  EXPECT(VSPLAT_OK, vsplat_reconstruct_async(device, model, input, &options, NULL, &second));
  EXPECT(VSPLAT_OK, vsplat_job_wait(second, patience(), &state));
  HOLD(state == VSPLAT_JOB_FAILED);
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_job_result(second, NULL));
  HOLD(strstr(vsplat_last_error(), "near_plane") != NULL);
  vsplat_job_release(second);
  EXPECT(VSPLAT_OK, vsplat_device_trim(device)); /* it is free again */
  vsplat_scene_release(want);
}

/* Starts drawing this many pictures, which takes a while. */
static vsplat_job begin_drawing(vsplat_device device, vsplat_scene scene, size_t count,
                                const vsplat_job_options* options) {
  static float colour[256 * 256 * 3];
  vsplat_camera* cameras = calloc(count, sizeof *cameras);
  vsplat_picture* pictures = calloc(count, sizeof *pictures);
  vsplat_job out = NULL;
  size_t i;
  for (i = 0; i < count; ++i) {
    const vsplat_camera camera = VSPLAT_CAMERA_INIT;
    const vsplat_picture picture = VSPLAT_PICTURE_INIT;
    cameras[i] = camera;
    cameras[i].width = cameras[i].height = 256;
    cameras[i].fx = cameras[i].fy = 300;
    cameras[i].cx = cameras[i].cy = 128;
    cameras[i].w2c[11] = 2;
    pictures[i] = picture;
    pictures[i].capacity = 256 * 256;
    pictures[i].colour = colour;
  }
  EXPECT(VSPLAT_OK, vsplat_render_async(device, scene, cameras, count, NULL, pictures, options, &out));
  free(cameras); /* all of it was copied */
  free(pictures);
  return out;
}

static void jobs_queue_and_stop(vsplat_device device, vsplat_model model, vsplat_input input) {
  const vsplat_reconstruct_options options = some_voxels();
  vsplat_scene scene = NULL, none = NULL;
  vsplat_job running, queued = NULL;
  vsplat_job_state state = VSPLAT_JOB_QUEUED;
  double cancelled_at;
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, model, input, &options, &scene));
  running = begin_drawing(device, scene, 100000, NULL);
  EXPECT(VSPLAT_OK, vsplat_reconstruct_async(device, model, input, &options, NULL, &queued));
  EXPECT(VSPLAT_ERROR_BUSY, vsplat_reconstruct(device, model, input, &options, &none));
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_job_result(running, NULL));
  EXPECT(VSPLAT_OK, vsplat_job_wait(running, 0.2, &state));
  HOLD(state == VSPLAT_JOB_RUNNING);
  EXPECT(VSPLAT_OK, vsplat_job_wait(queued, 0, &state));
  HOLD(state == VSPLAT_JOB_QUEUED);
  EXPECT(VSPLAT_OK, vsplat_job_cancel(queued));
  vsplat_scene_release(scene); /* the job keeps it */
  cancelled_at = now();
  EXPECT(VSPLAT_OK, vsplat_job_cancel(running));
  EXPECT(VSPLAT_OK, vsplat_job_wait(running, -1, &state));
  printf("a drawing was stopped in %.0f ms\n", 1e3 * (now() - cancelled_at));
  HOLD(state == VSPLAT_JOB_CANCELLED && now() - cancelled_at < patience());
  EXPECT(VSPLAT_ERROR_CANCELLED, vsplat_job_result(running, &none));
  EXPECT(VSPLAT_OK, vsplat_job_wait(queued, -1, &state));
  HOLD(state == VSPLAT_JOB_CANCELLED && !none);
  EXPECT(VSPLAT_ERROR_CANCELLED, vsplat_job_result(queued, &none));
  EXPECT(VSPLAT_OK, vsplat_job_cancel(queued)); /* a second time: no effect */
  vsplat_job_release(queued);
  vsplat_job_release(running);
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, model, input, &options, &scene));
  vsplat_scene_release(scene);
}

static int32_t is_busy(void* user, const char* stage, double done) {
  vsplat_device* device = user;
  (void)stage, (void)done;
  EXPECT(VSPLAT_ERROR_BUSY, vsplat_device_trim(*device));
  return 1;
}

/* A job's callback can neither use its device nor wait for later jobs. */
static void jobs_know_their_thread(vsplat_device device, vsplat_model model, vsplat_input input) {
  vsplat_reconstruct_options options = some_voxels();
  vsplat_job_options on_end = VSPLAT_JOB_OPTIONS_INIT;
  vsplat_scene scene = NULL;
  vsplat_job first = NULL, long_one;
  vsplat_job_state state = VSPLAT_JOB_QUEUED;
  ended e;
  memset(&e, 0, sizeof e);
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, model, input, &options, &scene));
  options.progress = is_busy;
  options.user = &device;
  on_end.on_end = has_ended;
  on_end.user = &e;
  {
    vsplat_job hold = begin_drawing(device, scene, 1000, NULL); /* so that both are queued when the first ends */
    EXPECT(VSPLAT_OK, vsplat_reconstruct_async(device, model, input, &options, &on_end, &first));
    long_one = e.other = begin_drawing(device, scene, 100000, NULL);
    vsplat_job_release(hold); /* it continues */
  }
  EXPECT(VSPLAT_OK, vsplat_job_wait(first, -1, &state));
  HOLD(state == VSPLAT_JOB_DONE);
  HOLD(is_set(&e.calls)); /* the caller may reuse its data */
  HOLD(e.waited == VSPLAT_ERROR_BUSY);
  EXPECT(VSPLAT_OK, vsplat_job_cancel(long_one));
  EXPECT(VSPLAT_OK, vsplat_job_wait(long_one, -1, &state));
  vsplat_job_release(long_one);
  vsplat_job_release(first);
  vsplat_scene_release(scene);
}

static void releases_device(void* user, vsplat_job job) {
  int* done = user;
  (void)job;
  set(done);
}

/* A job may hold the last reference to a device. */
static void the_last_job_closes(vsplat_model model, vsplat_input input) {
  const vsplat_reconstruct_options options = some_voxels();
  vsplat_job_options on_end = VSPLAT_JOB_OPTIONS_INIT;
  vsplat_device device = NULL;
  vsplat_job job = NULL;
  int done = 0;
  on_end.on_end = releases_device;
  on_end.user = &done;
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  EXPECT(VSPLAT_OK, vsplat_reconstruct_async(device, model, input, &options, &on_end, &job));
  vsplat_device_release(device);
  vsplat_job_release(job);
  while (!is_set(&done)) pause_for(0.001);
  pause_for(0.2); /* for its thread */
}

/* ------------------------------------------------------------------------------------------------ stopping calls */

typedef struct stopper {
  vsplat_device device;
  double after, cancelled_at;
} stopper;

static void* stops(void* user) {
  stopper* s = user;
  pause_for(s->after);
  s->cancelled_at = now();
  EXPECT(VSPLAT_OK, vsplat_device_cancel(s->device));
  return NULL;
}

/* A stopped training leaves a checkpoint of its last step and continues from it. */
static void stops_a_training(vsplat_device device) {
  static const char* const endless =
      "{\"model\": \"micro\", \"steps\": 100000, \"procedural\": 1, \"checkpoint_every\": 0, \"sheet_every\": 0}";
  char run[] = "/tmp/vsplat-jobs-XXXXXX";
  char command[128];
  vsplat_train_options options = VSPLAT_TRAIN_OPTIONS_INIT;
  vsplat_train_result result = VSPLAT_TRAIN_RESULT_INIT;
  stopper s = {NULL, 1.5, 0};
  pthread_t id;
  s.device = device;
  HOLD(mkdtemp(run) != NULL);
  options.output = run;
  HOLD(pthread_create(&id, NULL, stops, &s) == 0);
  EXPECT(VSPLAT_ERROR_CANCELLED, vsplat_train(device, endless, &options, &result));
  HOLD(pthread_join(id, NULL) == 0);
  printf("a training was stopped in %.0f ms: %s\n", 1e3 * (now() - s.cancelled_at), vsplat_last_error());
  HOLD(now() - s.cancelled_at < patience() && strstr(vsplat_last_error(), "checkpoint-") != NULL);
  options.resume = 1;
  s.after = 1;
  HOLD(pthread_create(&id, NULL, stops, &s) == 0);
  EXPECT(VSPLAT_ERROR_CANCELLED, vsplat_train(device, endless, &options, &result));
  HOLD(pthread_join(id, NULL) == 0);
  snprintf(command, sizeof command, "rm -r %s", run);
  HOLD(system(command) == 0);
}

/* A network that takes seconds. */
static void stops_a_reconstruction(vsplat_device device) {
  vsplat_model model = make_model("small", 3);
  vsplat_model_info info = VSPLAT_MODEL_INFO_INIT;
  vsplat_input input;
  vsplat_scene scene = NULL;
  stopper s = {NULL, 0, 0};
  pthread_t id;
  double whole;
  s.device = device;
  EXPECT(VSPLAT_OK, vsplat_model_get_info(model, &info));
  input = make_input(model, info.image);
  EXPECT(VSPLAT_OK, vsplat_device_prepare(device, model, NULL));
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, model, input, NULL, &scene));
  vsplat_scene_release(scene);
  scene = NULL;
  whole = now();
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, model, input, NULL, &scene));
  whole = now() - whole;
  vsplat_scene_release(scene);
  scene = NULL;
  s.after = whole / 4;
  HOLD(pthread_create(&id, NULL, stops, &s) == 0);
  EXPECT(VSPLAT_ERROR_CANCELLED, vsplat_reconstruct(device, model, input, NULL, &scene));
  HOLD(pthread_join(id, NULL) == 0);
  printf("a reconstruction of %.0f ms was stopped in %.0f ms\n", 1e3 * whole, 1e3 * (now() - s.cancelled_at));
  HOLD(!scene && now() - s.cancelled_at < patience());
  EXPECT(VSPLAT_OK, vsplat_reconstruct(device, model, input, NULL, &scene)); /* no effect of it remains */
  vsplat_scene_release(scene);
  EXPECT(VSPLAT_OK, vsplat_device_cancel(device)); /* there is nothing to stop */
  vsplat_input_release(input);
  vsplat_model_release(model);
}

int main(void) {
  vsplat_device device = NULL;
  vsplat_model model = make_model("micro", 5), other = make_model("micro", 6);
  vsplat_input input = make_input(model, edge);
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  prepares(model, input);
  lists_programs(model);
  streams_at_once(device, model, other, input);
  jobs_give_what_calls_give(device, model, input);
  jobs_queue_and_stop(device, model, input);
  jobs_know_their_thread(device, model, input);
  the_last_job_closes(model, input);
  stops_a_reconstruction(device);
  stops_a_training(device);
  vsplat_input_release(input);
  vsplat_model_release(other);
  vsplat_model_release(model);
  vsplat_device_release(device);
  return failures == 0 ? 0 : 1;
}
