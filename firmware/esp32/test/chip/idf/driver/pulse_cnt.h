#pragma once

using pcnt_unit_handle_t = void*;
