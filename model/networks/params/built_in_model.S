/* The bytes of the file VSPLAT_MODEL_FILE, or none where it is not defined: see built_in_model.h. */
  .section .rodata
  .globl vsplat_built_in_model_begin
  .hidden vsplat_built_in_model_begin
  .balign 16
vsplat_built_in_model_begin:
#ifdef VSPLAT_MODEL_FILE
  .incbin VSPLAT_MODEL_FILE
#endif
.Lend:
  .globl vsplat_built_in_model_bytes
  .hidden vsplat_built_in_model_bytes
  .balign 8
vsplat_built_in_model_bytes:
  .quad .Lend - vsplat_built_in_model_begin

  .section .note.GNU-stack,"",%progbits
