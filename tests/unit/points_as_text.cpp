// points_as_text FILE: what a .vdb of the keyword `bed` holds, as text: the time, the names of its arrays, then a line for each
// granule, in any order. For tests that are no C++.
#include <openvdb/openvdb.h>
#include <openvdb/points/PointDataGrid.h>

#include <cstdint>
#include <cstdio>
#include <exception>
#include <string>

namespace points = openvdb::points;

template <class Value, class Write>
void value(const points::PointDataTree::LeafNodeType& leaf, const std::string& name, openvdb::Index n, Write write) {
  write(points::AttributeHandle<Value>(leaf.constAttributeArray(name)).get(n));
}

int main(int, char** argv) {
  openvdb::initialize();
  openvdb::io::File file(argv[1]);
  try {
    file.open();
    const auto grid = openvdb::gridPtrCast<points::PointDataGrid>(file.readGrid("points"));
    std::printf("%.17g\n", grid->metaValue<double>("time"));
    const auto first = grid->tree().cbeginLeaf();
    if (!first) return 0;
    std::string names;
    for (const auto& name : first->attributeSet().descriptor().map()) names += (names.empty() ? "" : " ") + name.first;
    std::printf("%s\n", names.c_str());
    const auto whole = [](auto v) { std::printf("%lld ", static_cast<long long>(v)); };
    const auto vector = [](const openvdb::Vec3f& v) { std::printf("%.9g %.9g %.9g ", v[0], v[1], v[2]); };
    for (auto leaf = grid->tree().cbeginLeaf(); leaf; ++leaf)
      for (auto at = leaf->beginIndexOn(); at; ++at) {
        value<int>(*leaf, "id", *at, whole);
        const openvdb::Vec3f in_voxel = points::AttributeHandle<openvdb::Vec3f>(leaf->constAttributeArray("P")).get(*at);
        vector(openvdb::Vec3f(grid->indexToWorld(at.getCoord().asVec3d() + openvdb::Vec3d(in_voxel))));
        value<float>(*leaf, "pscale", *at, [](float r) { std::printf("%.9g ", r); });
        value<openvdb::Vec3f>(*leaf, "v", *at, vector);
        for (const char* name : {"type", "state", "awake", "woke"}) value<int>(*leaf, name, *at, whole);
        value<std::int64_t>(*leaf, "body", *at, whole);
        std::printf("\n");
      }
  } catch (const std::exception& e) {
    std::fprintf(stderr, "%s: %s\n", argv[1], e.what());
    return 1;
  }
}
