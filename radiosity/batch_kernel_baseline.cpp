// SPDX-License-Identifier: GPL-3.0-or-later
#define INTERGLOW_LANES 2
#define INTERGLOW_KERNELS baseline_kernels
#define INTERGLOW_KERNEL_NAME "SSE2"
#include "radiosity/batch_kernel_source.h"
