# A hash of the sources that a re-run executes. A black box has it, because only the same core can
# re-run it. CMake runs again when one of them changes.
file(GLOB wheelwire_hashed CONFIGURE_DEPENDS ${CMAKE_CURRENT_LIST_DIR}/core/*.cpp
     ${CMAKE_CURRENT_LIST_DIR}/core/*.hpp ${CMAKE_CURRENT_LIST_DIR}/sensors/*.cpp
     ${CMAKE_CURRENT_LIST_DIR}/sensors/*.hpp)
list(SORT wheelwire_hashed)
set(wheelwire_hashes "")
foreach(source IN LISTS wheelwire_hashed)
  file(SHA256 ${source} hash)
  get_filename_component(name ${source} NAME)
  string(APPEND wheelwire_hashes "${name} ${hash}\n")
endforeach()
string(SHA256 wheelwire_core_hash "${wheelwire_hashes}")
string(SUBSTRING ${wheelwire_core_hash} 0 8 wheelwire_core_hash)
set_property(DIRECTORY APPEND PROPERTY CMAKE_CONFIGURE_DEPENDS ${wheelwire_hashed})
set_source_files_properties(
  ${CMAKE_CURRENT_LIST_DIR}/core/core_hash.cpp
  PROPERTIES COMPILE_DEFINITIONS WHEELWIRE_CORE_HASH=0x${wheelwire_core_hash})
