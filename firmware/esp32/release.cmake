# The release that the firmware reports in DeviceHello, on the chip and in the simulator. Sets
# `wheelwire_version` and `wheelwire_release_definitions`.

# One version for the distribution and its firmware.
set(pyproject ${CMAKE_CURRENT_LIST_DIR}/../../pyproject.toml)
file(STRINGS ${pyproject} version_line REGEX "^version = ")
string(REGEX MATCH "([0-9]+)\\.([0-9]+)\\.([0-9]+)" wheelwire_version "${version_line}")
set(wheelwire_release_definitions
    WHEELWIRE_VERSION_MAJOR=${CMAKE_MATCH_1} WHEELWIRE_VERSION_MINOR=${CMAKE_MATCH_2}
    WHEELWIRE_VERSION_PATCH=${CMAKE_MATCH_3})

# The commit; 0 outside a checkout. CMake runs again when it changes.
find_package(Git QUIET)
set(git_hash 0)
if(Git_FOUND)
  execute_process(
    COMMAND ${GIT_EXECUTABLE} rev-parse --short=8 HEAD
    WORKING_DIRECTORY ${CMAKE_CURRENT_LIST_DIR}
    OUTPUT_VARIABLE git_output
    OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET
    RESULT_VARIABLE git_result)
  if(git_result EQUAL 0)
    string(SUBSTRING "${git_output}" 0 8 git_hash)
    execute_process(
      COMMAND ${GIT_EXECUTABLE} rev-parse --path-format=absolute --git-path logs/HEAD
      WORKING_DIRECTORY ${CMAKE_CURRENT_LIST_DIR}
      OUTPUT_VARIABLE git_log
      OUTPUT_STRIP_TRAILING_WHITESPACE ERROR_QUIET)
    if(EXISTS "${git_log}")
      set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS "${git_log}")
    endif()
  endif()
endif()
list(APPEND wheelwire_release_definitions WHEELWIRE_GIT_HASH=0x${git_hash})
