/* The built-in model, as C programs use it. Run it with a library that contains a model of configuration micro,
   and with one that contains none: built_in_model_test micro|none FILE; FILE is written and read back */
#include <stdlib.h>
#include <string.h>
#include <vsplat/vsplat.h>

#include "checks.h"

static void none(void) {
  vsplat_model model = NULL;
  vsplat_hash_state hash = VSPLAT_HASH_ABSENT;
  char* text = NULL;
  EXPECT(VSPLAT_ERROR_FILE, vsplat_model_load(NULL, &model));
  HOLD(strstr(vsplat_last_error(), "without a model") != NULL);
  HOLD(strstr(vsplat_last_error(), "vsplat_model_load") != NULL);
  EXPECT(VSPLAT_ERROR_FILE, vsplat_model_inspect(NULL, NULL, &text));
  EXPECT(VSPLAT_ERROR_FILE, vsplat_model_verify(NULL, &hash));
  HOLD(!model && !text);
}

/* The built-in model is saved as half floats and loaded again. */
static void save(vsplat_model model, const char* path) {
  vsplat_model again = NULL;
  vsplat_model_info info = VSPLAT_MODEL_INFO_INIT;
  char* text = NULL;
  EXPECT(VSPLAT_ERROR_USAGE, vsplat_model_save_as(model, path, (vsplat_dtype)7));
  EXPECT(VSPLAT_OK, vsplat_model_save_as(model, path, VSPLAT_DTYPE_F16));
  EXPECT(VSPLAT_OK, vsplat_model_inspect(path, NULL, &text));
  HOLD(text && strstr(text, "\"F16\"") && !strstr(text, "\"F32\""));
  EXPECT(VSPLAT_OK, vsplat_model_load(path, &again));
  EXPECT(VSPLAT_OK, vsplat_model_get_info(again, &info));
  HOLD(info.image == 16 && info.hash == VSPLAT_HASH_VERIFIED);
  vsplat_text_free(text);
  vsplat_model_release(again);
}

static void micro(const char* path) {
  vsplat_model model = NULL;
  vsplat_model_info info = VSPLAT_MODEL_INFO_INIT;
  vsplat_hash_state hash = VSPLAT_HASH_ABSENT;
  char* text = NULL;
  EXPECT(VSPLAT_OK, vsplat_model_load(NULL, &model));
  EXPECT(VSPLAT_OK, vsplat_model_get_info(model, &info));
  HOLD(info.image == 16 && info.parameters == 38551 && info.hash == VSPLAT_HASH_VERIFIED);
  EXPECT(VSPLAT_OK, vsplat_model_inspect(NULL, &info, &text));
  HOLD(info.hash == VSPLAT_HASH_STATED);
  HOLD(text && strstr(text, "\"F32\""));
  EXPECT(VSPLAT_OK, vsplat_model_verify(NULL, &hash));
  HOLD(hash == VSPLAT_HASH_VERIFIED);
  save(model, path);
  vsplat_text_free(text);
  vsplat_model_release(model);
}

int main(int argc, char** argv) {
  if (argc != 3) return 2;
  if (strcmp(argv[1], "none") == 0)
    none();
  else
    micro(argv[2]);
  return failures ? 1 : 0;
}
