//! Goldens and committed reports are of scenes with these hashes: a change to a
//! generator, the hash or the light must not move one unseen. After a wanted change,
//! approve goldens and make reports again.

use aogauge_scenes::library;

const HASHES: [(&str, &str); 20] = [
    ("curtain-open", "d8719d593b797c9d40c3d36d755b66d4ed60b8bf9432f993d4141047e4a61b8e"),
    ("curtain-arcade", "534cd090d5ef6590c11df2184cb9a2e67721107e7a037d6f3ded8cab8c6dec94"),
    ("curtain-room", "d655b242993d2add1f06dd9807ab83814cf104d86c3b466614a09a819387d899"),
    ("pillar", "b518cdc515c2c75f09bd474f21d3d047af6310f84b88d8d5005dfda7ea758c36"),
    ("plane", "f725979de2b906bb679dfe7ced516fd436a8bde8fe6b2d1cb49f37321389ae14"),
    ("corner", "d36bfe043b4a5a2d89975974d8cbc6d18c2d4456449892b0aaa88a5002d1f8c1"),
    ("thick-box", "ba08b2eb5285251b5944966453dcf054f6f17bf8e7e813471cecbb966320c789"),
    ("atrium", "3490d604ab0095f91aea052a70da55a1dda8c97e019e855ed6cdc146cfa1a502"),
    ("pleated-curtain", "71444010ff27707658abdd549a76d9b1b270b5083f04222a8d1e49530d08f987"),
    ("banner", "5748427d6dad055285b151bcc05c803cd5f788d199d8076f92d3a8b45100ba69"),
    ("fence", "2e85ea6ff18bcf28ffb404bd16131a958baf321ae5298d6da8f1260a9f15293b"),
    ("blinds", "ae830d8551e9b9911e2c15831a5f4bc4b130e2fca208292752f475c2f38963ec"),
    ("shelf", "1021920238dfbb8abef5294d5b60f9355f13614203bccac74cec459cf8192e4c"),
    ("table", "be711fc5fe572001862ee5cb758edf0c48292696115d5f9e85f7cfbc8f7a5968"),
    ("leaves", "682f86f7eaad9a8d50d0406cad0c2760f8daa502947a176c4a2be4f701e31be1"),
    ("cables", "e7c0301f9088988a5bd5a97459fff9c4b707d422fa5f8b8a04a706c279caf311"),
    ("ceiling-light", "4bbce901f91325b65a92389992d01453f9a087bb76cbe21475c39a99bc6eb788"),
    ("crevice", "d55fc53c08d32fed101ba74ec0bbb4de8f8d008f8dad49ff6277f34f3a2c7325"),
    ("sphere", "0a591cf63ef9cac83db5748a4f82339ae3e53c839d80d016f4cfd557a7855a79"),
    ("ridge", "407b63cb21f17ff48e4b3670233fb9460ace9988748983bcea80a2918fe45f9b"),
];

#[test]
fn the_built_in_scenes_keep_their_hash() {
    assert_eq!(HASHES.len(), library::SCENES.len());
    for (name, hash) in HASHES {
        assert_eq!(library::scene(name).unwrap().hash(), hash, "{name}");
    }
}
