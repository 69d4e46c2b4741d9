//! Goldens are bound to the hash of their scene: a change to a generator, the
//! hash or the light must not move one unseen.

use aogauge_scenes::library;

const HASHES: [(&str, &str); 7] = [
    ("curtain-open", "73b6e00278235b07094f378e26370292171f8be6710bef904cf0b34beaa18ced"),
    ("curtain-arcade", "d611d6f63e321eda29d26a7e2ad851f1c3263ed00c5285ec2d8b6b296eae054b"),
    ("curtain-room", "5f0554cdd5225e43ed63df87e70d90d591e2aa274d2bfc7a9422c4de4480b043"),
    ("pillar", "b1f53c4a938d14c5f2fa97ce1032a6cdc9004260517e0d6a822d607ccafdbce2"),
    ("plane", "fa230d106dfd19478b7071e458fe0a5d014a32ee735f3a1e8446552fc9b858d3"),
    ("corner", "da3dbb64b4dbcb87046f4081a6c38f79940722c85a0d2ecfa4061d7c91ab8631"),
    ("thick-box", "93978f6dacc8d72f227ccbf33678a77d6007bba621de995463cdc1b72deed3dc"),
];

#[test]
fn the_scenes_with_goldens_keep_their_hash() {
    for (name, hash) in HASHES {
        assert_eq!(library::scene(name).unwrap().hash(), hash, "{name}");
    }
}
