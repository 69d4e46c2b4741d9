// How a surface scatters light. Twin: render/brdf.rs, which says where the
// formulas come from.

const PI = 3.14159265358979323846;
const DIELECTRIC = 0.04;
const LEAST_ALPHA = 1e-3;

// A metallic-roughness material at a point.
struct Here {
    base_color: vec3<f32>,
    metallic: f32,
    emission: vec3<f32>,
    roughness: f32,
}

fn diffuse_albedo(here: Here) -> vec3<f32> {
    return here.base_color * (1.0 - here.metallic);
}

fn distribution(nh: f32, alpha: f32) -> f32 {
    let d = (1.0 - nh) * (1.0 + nh) + alpha * alpha * nh * nh;
    return alpha * alpha / (PI * d * d);
}

fn smith(cosine: f32, a2: f32) -> f32 {
    return sqrt(a2 + (1.0 - a2) * cosine * cosine);
}

fn visibility(nl: f32, nv: f32, alpha: f32) -> f32 {
    let a2 = alpha * alpha;
    return 0.5 / (nl * smith(nv, a2) + nv * smith(nl, a2));
}

fn brdf(here: Here, normal: vec3<f32>, light: vec3<f32>, viewer: vec3<f32>) -> vec3<f32> {
    let nl = dot(normal, light);
    let nv = dot(normal, viewer);
    if nl <= 0.0 || nv <= 0.0 {
        return vec3<f32>();
    }
    let between = light + viewer;
    let size = length(between);
    let middle = select(vec3<f32>(), between / size, size > 0.0);
    let nh = clamp(dot(normal, middle), 0.0, 1.0);
    let vh = clamp(dot(viewer, middle), 0.0, 1.0);
    let alpha = max(here.roughness * here.roughness, LEAST_ALPHA);
    let head_on = mix(vec3<f32>(DIELECTRIC), here.base_color, here.metallic);
    let grazing = (1.0 - vh) * (1.0 - vh) * (1.0 - vh) * (1.0 - vh) * (1.0 - vh);
    let fresnel = head_on + (1.0 - head_on) * grazing;
    let specular = fresnel * (distribution(nh, alpha) * visibility(nl, nv, alpha));
    return (1.0 - fresnel) * diffuse_albedo(here) * (1.0 / PI) + specular;
}
