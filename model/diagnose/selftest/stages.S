/* The bytes of stages.safetensors: see stages.h. */
  .section .rodata
  .globl vsplat_selftest_stages_begin
  .hidden vsplat_selftest_stages_begin
  .balign 16
vsplat_selftest_stages_begin:
  .incbin VSPLAT_STAGES_FILE
.Lend:
  .globl vsplat_selftest_stages_bytes
  .hidden vsplat_selftest_stages_bytes
  .balign 8
vsplat_selftest_stages_bytes:
  .quad .Lend - vsplat_selftest_stages_begin

  .section .note.GNU-stack,"",%progbits
