/* A call keeps its arguments alive even if they are released meanwhile; callbacks may call the library; a process
   that exits ends its jobs. Prints every check that fails; exits 1 if any did. With an argument, this is the
   process that exits: lifetimes_test NUMBER. */
#include <pthread.h>
#include <spawn.h>
#include <stdlib.h>
#include <string.h>
#include <sys/wait.h>
#include <unistd.h>

#include "micro_input.h"

enum { EDGE = 16, PIXELS = EDGE * EDGE };

extern char** environ;

typedef struct given {
  vsplat_device device;
  vsplat_model model;
  vsplat_input input;
  vsplat_scene scene;
  int on_a_thread, calls;
} given;

static void* let_go(void* user) {
  given* all = user;
  vsplat_device_release(all->device);
  vsplat_model_release(all->model);
  vsplat_input_release(all->input);
  vsplat_scene_release(all->scene);
  return NULL;
}

/* The last references are released while the call runs: here, or on another thread. */
static int32_t letting_go(void* user, const char* stage, double done) {
  given* all = user;
  pthread_t thread;
  (void)stage, (void)done;
  if (all->calls++) return 1;
  if (!all->on_a_thread) {
    let_go(all);
  } else {
    HOLD(pthread_create(&thread, NULL, let_go, all) == 0);
    HOLD(pthread_join(thread, NULL) == 0);
  }
  return 1;
}

static vsplat_camera a_camera(void) {
  vsplat_camera out = VSPLAT_CAMERA_INIT;
  out.width = out.height = EDGE;
  out.fx = out.fy = 1.25 * EDGE;
  out.cx = out.cy = EDGE / 2.0;
  out.w2c[11] = 2;
  return out;
}

static vsplat_scene make_scene(float place) {
  static const float one[16] = {1};
  float mean[3] = {0}, scale[3] = {0.2f, 0.2f, 0.2f}, opacity = 0.8f;
  vsplat_scene_info info = VSPLAT_SCENE_INFO_INIT;
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  vsplat_scene out = NULL;
  mean[0] = place;
  info.count = arrays.capacity = 1;
  arrays.means = mean, arrays.scales = scale, arrays.opacities = &opacity;
  arrays.rotations = arrays.sh = (float*)one;
  EXPECT(VSPLAT_OK, vsplat_scene_create(&info, &arrays, &out));
  return out;
}

static given make_given(int stream, int on_a_thread) {
  given out = {NULL, NULL, NULL, NULL, on_a_thread, 0};
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &out.device));
  if (stream) {
    vsplat_device of = out.device;
    EXPECT(VSPLAT_OK, vsplat_stream_create(of, &out.device));
    vsplat_device_release(of);
  }
  out.model = make_model("micro", 3);
  out.input = make_input(out.model, EDGE);
  out.scene = make_scene(0);
  return out;
}

static void test_letting_go(int stream, int on_a_thread) {
  static float colour[3 * PIXELS];
  vsplat_reconstruct_options how = some_voxels();
  vsplat_render_options drawn = VSPLAT_RENDER_OPTIONS_INIT;
  vsplat_picture picture = VSPLAT_PICTURE_INIT;
  vsplat_scene want = NULL, made = NULL;
  const vsplat_camera camera = a_camera();
  given all = make_given(stream, on_a_thread);
  EXPECT(VSPLAT_OK, vsplat_reconstruct(all.device, all.model, all.input, &how, &want));
  how.progress = letting_go, how.user = &all;
  EXPECT(VSPLAT_OK, vsplat_reconstruct(all.device, all.model, all.input, &how, &made));
  HOLD(all.calls > 0 && are_equal(made, want));
  vsplat_scene_release(made);
  vsplat_scene_release(want);
  all = make_given(stream, on_a_thread);
  drawn.progress = letting_go, drawn.user = &all;
  picture.capacity = PIXELS, picture.colour = colour;
  memset(colour, 0, sizeof colour);
  EXPECT(VSPLAT_OK, vsplat_render_views(all.device, all.scene, &camera, 1, &drawn, &picture));
  HOLD(all.calls == 1);
  HOLD(colour[3 * (PIXELS / 2 + EDGE / 2)] != 0);
}

/* A job's end callback that releases the last reference to the job and to all of its arguments. */
static void last_of_all(void* user, vsplat_job job) {
  vsplat_job_release(job);
  let_go(user);
}

static void test_job_let_go(void) {
  vsplat_reconstruct_options how = some_voxels();
  vsplat_job_options options = VSPLAT_JOB_OPTIONS_INIT;
  vsplat_job job = NULL;
  vsplat_job_state state = VSPLAT_JOB_QUEUED;
  given all = make_given(1, 0);
  options.on_end = last_of_all, options.user = &all;
  EXPECT(VSPLAT_OK, vsplat_reconstruct_async(all.device, all.model, all.input, &how, &options, &job));
  vsplat_job_retain(job);
  EXPECT(VSPLAT_OK, vsplat_job_wait(job, -1, &state));
  HOLD(state == VSPLAT_JOB_DONE);
  vsplat_job_release(job);
}

/* A change of a scene while it is drawn takes effect in the next call. */
typedef struct change {
  vsplat_scene scene;
  int calls;
} change;

static int32_t changing(void* user, const char* stage, double done) {
  change* to = user;
  const float hidden = 0;
  vsplat_gaussians arrays = VSPLAT_GAUSSIANS_INIT;
  (void)stage, (void)done;
  arrays.capacity = 1, arrays.opacities = (float*)&hidden;
  if (!to->calls++) EXPECT(VSPLAT_OK, vsplat_scene_update(to->scene, &arrays));
  return 1;
}

static void test_changes(void) {
  static float alpha[2][PIXELS];
  vsplat_camera cameras[2] = {VSPLAT_CAMERA_INIT, VSPLAT_CAMERA_INIT};
  vsplat_picture pictures[2] = {VSPLAT_PICTURE_INIT, VSPLAT_PICTURE_INIT};
  vsplat_render_options drawn = VSPLAT_RENDER_OPTIONS_INIT;
  vsplat_device device = NULL;
  change to = {make_scene(0), 0};
  int i;
  for (i = 0; i < 2; ++i) {
    cameras[i] = a_camera();
    pictures[i].capacity = PIXELS, pictures[i].alpha = alpha[i];
  }
  drawn.progress = changing, drawn.user = &to;
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  EXPECT(VSPLAT_OK, vsplat_render_views(device, to.scene, cameras, 2, &drawn, pictures));
  HOLD(memcmp(alpha[0], alpha[1], sizeof alpha[0]) == 0);
  HOLD(alpha[1][PIXELS / 2 + EDGE / 2] > 0.5f);
  EXPECT(VSPLAT_OK, vsplat_render_views(device, to.scene, cameras, 2, &drawn, pictures));
  HOLD(alpha[1][PIXELS / 2 + EDGE / 2] == 0);
  vsplat_scene_release(to.scene);
  vsplat_device_release(device);
}

/* Callbacks that call the library. */
typedef struct asked {
  vsplat_scene scene;
  const char* other;
  int replaced, written, messages;
} asked;

static int32_t replaces(void* user, const char* path) {
  asked* a = user;
  if (strcmp(path, a->other) != 0 && !a->replaced++) EXPECT(VSPLAT_OK, vsplat_scene_save(a->scene, a->other));
  return 1;
}
static void wrote(void* user, const char* path, int32_t created) {
  asked* a = user;
  vsplat_scene again = NULL;
  (void)created;
  if (a->written++) return;
  EXPECT(VSPLAT_OK, vsplat_scene_load(path, &again));
  vsplat_scene_release(again);
  EXPECT(VSPLAT_OK, vsplat_file_rules_set(NULL)); /* the rules being consulted */
}
static void logs(void* user, vsplat_log_level level, const char* text) {
  asked* a = user;
  vsplat_views views = NULL;
  (void)level, (void)text;
  if (a->messages++) return;
  EXPECT(VSPLAT_ERROR_FILE, vsplat_views_load("/nonexistent/list.json", NULL, &views));
  vsplat_log_set(NULL, NULL);
}

static void test_calls_back(void) {
  char folder[] = "/tmp/vsplat-lifetimes-XXXXXX", one[64], other[64];
  vsplat_file_rules rules = VSPLAT_FILE_RULES_INIT;
  asked a = {make_scene(0), other, 0, 0, 0};
  vsplat_model model = make_model("micro", 3);
  HOLD(mkdtemp(folder) != NULL);
  snprintf(one, sizeof one, "%s/one.ply", folder);
  snprintf(other, sizeof other, "%s/other.ply", folder);
  EXPECT(VSPLAT_OK, vsplat_scene_save(a.scene, one));
  rules.may_replace = replaces, rules.on_written = wrote, rules.user = &a;
  EXPECT(VSPLAT_OK, vsplat_file_rules_set(&rules));
  EXPECT(VSPLAT_OK, vsplat_scene_save(a.scene, one));
  HOLD(a.replaced == 1 && a.written == 1);
  HOLD(access(other, F_OK) == 0);
  EXPECT(VSPLAT_OK, vsplat_file_rules_set(NULL));
  vsplat_log_set(logs, &a);
  vsplat_input_release(make_input(model, EDGE)); /* logs what it found */
  HOLD(a.messages == 1);
  vsplat_log_set(NULL, NULL);
  remove(one), remove(other), remove(folder);
  vsplat_scene_release(a.scene);
  vsplat_model_release(model);
}

/* A process that ends while its jobs run or wait. */
static int32_t tells(void* user, const char* stage, double done) {
  const char byte = 1;
  (void)stage, (void)done;
  return write(*(int*)user, &byte, 1) == 1;
}

/* Static handles, which a search for leaks sees: they are never released. */
static int exits_with_jobs(int which) {
  static vsplat_device device, stream;
  static vsplat_model model;
  static vsplat_input input;
  static vsplat_job jobs[2][20];
  static int ends[2];
  vsplat_reconstruct_options how = VSPLAT_RECONSTRUCT_OPTIONS_INIT;
  char byte = 0;
  int i;
  model = make_model("micro", 3), input = make_input(model, EDGE);
  HOLD(pipe(ends) == 0);
  how.progress = tells, how.user = &ends[1];
  EXPECT(VSPLAT_OK, vsplat_device_open(NULL, &device));
  EXPECT(VSPLAT_OK, vsplat_stream_create(device, &stream));
  for (i = 0; i < 20; ++i) {
    EXPECT(VSPLAT_OK, vsplat_reconstruct_async(device, model, input, &how, NULL, &jobs[0][i]));
    if (which & 1) EXPECT(VSPLAT_OK, vsplat_reconstruct_async(stream, model, input, &how, NULL, &jobs[1][i]));
  }
  HOLD(read(ends[0], &byte, 1) == 1);
  if (which & 2) exit(failures != 0);
  return failures != 0;
}

static void test_exits(const char* program) {
  int which;
  for (which = 0; which < 4; ++which) {
    char number[2] = {(char)('0' + which), 0};
    char* arguments[] = {(char*)program, number, NULL};
    pid_t child = 0;
    int status = -1;
    HOLD(posix_spawn(&child, program, NULL, NULL, arguments, environ) == 0);
    HOLD(waitpid(child, &status, 0) == child);
    HOLD(WIFEXITED(status) && WEXITSTATUS(status) == 0);
  }
}

int main(int argc, char** argv) {
  int i;
  if (argc > 1) return exits_with_jobs(argv[1][0] - '0');
  for (i = 0; i < 4; ++i) test_letting_go(i & 1, i & 2);
  test_job_let_go();
  test_changes();
  test_calls_back();
  test_exits(argv[0]);
  if (failures) printf("%d checks do not hold\n", failures);
  return failures != 0;
}
