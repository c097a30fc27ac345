use std::sync::Arc;
use drape_cloth::scene::{Scene, SceneConfig};
use drape_cloth::math::{Purpose, Stream};
use drape_task::env::{Draping, EnvConfig, Tasks};

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let config: SceneConfig = SceneConfig::read(std::path::Path::new(&args[1])).unwrap();
    let seed: u64 = args[2].parse().unwrap();
    let limit: f64 = args[3].parse().unwrap();
    let scene = Arc::new(Scene::new(&config, |_| ()).unwrap());
    let env = EnvConfig::compact();
    let mut env_ = env.clone();
    env_.stencil_mm = 24.0; if let Ok(x) = std::env::var("STRAIN") { env_.drape_strain = x.parse().unwrap(); } let rate = drape_cloth::sim::lab("RATE", 0.0); if rate > 0.0 { env_.substep_rate = Some(rate); env_.contact_rate = Some(rate.min(1200.0)); }
    let mut d = Draping::new(scene.clone(), &env_, 1).unwrap();
    let mut stream = Stream::new(seed, Purpose::Evaluation, 0);
    let lam = &scene.lamina;
    let ny: usize = lam.yarns.iter().map(|y| y.vertices.len()-1).sum();
    let free: Vec<_> = lam.membranes.iter().filter(|m| !m.has_yarns).collect();
    println!("vertices {} yarn edges {} membranes {} free {}", lam.vertex_count(), ny, lam.membranes.len(), free.len());
    let mut step = 0; let mut told = 0;
    loop {
        let pr = d.state(0); let _ = &pr; let a = pick(&d, &mut stream);
        let v = d.vertex(a);
        
        let fin = d.press(&[v]);
        let _ = fin; step += 1;
        let s = d.state(0);
        let strain = lam.yarn_strain(&s.position);
        let (w, m) = strain.iter().enumerate().max_by(|a,b| a.1.total_cmp(b.1)).unwrap();
        if *m > limit && told < 12 {
            told += 1;
            if w < ny { println!("step {step} press {v:?} worst yarn edge {w} strain {m}"); }
            else { let k = (w-ny)/2; let mem = free[k];
                println!("step {step} press {v:?} membrane {k} family {} strain {m} area {:.2e}", (w-ny)%2, mem.area);
                for (i,&v) in mem.vertices.iter().enumerate() { let p = s.position[v as usize]; let r = lam.rest[v as usize];
                    let nyarn = lam.yarns.iter().filter(|y| y.vertices.contains(&v)).count();
                    println!("   v {v} rest {:.1} {:.1} at {:.1} {:.1} {:.1} speed {:.3} grad {:.0} {:.0} mass {:.2e} yarns {nyarn} touched {} draped {} phi {:.2}", r[0]*1e3,r[1]*1e3,p[0]*1e3,p[1]*1e3,p[2]*1e3, s.velocity[v as usize].iter().map(|x|x*x).sum::<f64>().sqrt(), mem.gradient[i][0], mem.gradient[i][1], lam.mass[v as usize], s.pressed.touched.contains(v as usize), s.pressed.draped.contains(v as usize), 1e3*scene.tool.distance(p).0); }
            }
        }
        if d.is_over(0) { break; }
    }
    if std::env::var("DEEP").is_ok() {
        for round in 0..2 {
        let s = d.state(0);
        let mut all: Vec<usize> = (0..lam.vertex_count()).collect();
        let phi = |v: usize| 1e3*scene.tool.distance(s.position[v]).0;
        all.sort_by(|&a,&b| phi(a).total_cmp(&phi(b)));
        for &v in &all[..4] {
            let p = s.position[v]; let r = lam.rest[v];
            println!("  {round} v {v} phi {:.3} exact {:.3} rest {:.1} {:.1} at {:.2} {:.2} {:.2} |v| {:.4} fixed {} touched {} draped {} yarns {}", phi(v), 1e3*scene.tool.surface.signed_distance(drape_cloth::math::Vec3::from(p)), r[0]*1e3,r[1]*1e3, p[0]*1e3,p[1]*1e3,p[2]*1e3, s.velocity[v].iter().map(|x|x*x).sum::<f64>().sqrt(), s.fixed.contains(v), s.pressed.touched.contains(v), s.pressed.draped.contains(v), lam.yarns.iter().filter(|y| y.vertices.contains(&(v as u32))).count());
        }
        for _ in 0..15 { d.press(&[None]); }
        }
        return;
    }
    if let Ok(w) = std::env::var("WATCH") {
        let w: usize = w.parse().unwrap();
        let world = drape_cloth::sim::World::new(scene.model.clone(), scene.tool.clone());
        use drape_cloth::sim::Backend;
        let mut cloth = drape_cloth::sim::Cpu::new(&world, 1, drape_cloth::sim::Precision::F32);
        for _ in 0..5 { d.press(&[None]); }
        cloth.load(0, &d.state(0));
        let rate: f64 = std::env::var("RATE").map_or(600.0, |r| r.parse().unwrap());
        for k in 0..16 {
            cloth.step(&env_.stepping().control(1.0 / rate), &[]);
            let s = cloth.snapshot(0);
            let p = s.position[w];
            println!("{k}: {:.2} {:.2} {:.2} v {:.2?} phi {:.3}", p[0]*1e3,p[1]*1e3,p[2]*1e3, s.velocity[w], 1e3*scene.tool.distance(p).0);
            let strain = lam.yarn_strain(&s.position);
            for (k, m) in free.iter().enumerate() { if m.vertices.contains(&(w as u32)) {
                let c = m.columns(&s.position);
                println!("     {k} {:?} strain {:.4} {:.4} sine {:.3} density {:.5} {:.5}", m.vertices.map(|w| (w, s.fixed.contains(w as usize))), strain[ny+2*k], strain[ny+2*k+1], c[0].dot(&c[1])/c[0].norm()/c[1].norm(), s.force_density[ny+2*k], s.force_density[ny+2*k+1]);
            }}
        }
        return;
    }
    for round in 0..4 {
        for _ in 0..5 { d.press(&[None]); }
        let s = d.state(0);
        let speed = |v: usize| s.velocity[v].iter().map(|x| x*x).sum::<f64>().sqrt();
        let mut all: Vec<usize> = (0..lam.vertex_count()).collect();
        all.sort_by(|&a,&b| speed(b).total_cmp(&speed(a)));
        println!("round {round} v_rms {}", 1e3*s.v_rms());
        for &v in &all[..4] {
            let p = s.position[v]; let r = lam.rest[v];
            println!("  v {v} speed {:.4} rest {:.1} {:.1} at {:.2} {:.2} {:.2} phi {:.3} touched {} draped {}", speed(v), r[0]*1e3,r[1]*1e3, p[0]*1e3,p[1]*1e3,p[2]*1e3, 1e3*scene.tool.distance(p).0, s.pressed.touched.contains(v), s.pressed.draped.contains(v));
            if round == 3 {
            let strain = lam.yarn_strain(&s.position);
            for (k, m) in free.iter().enumerate() { if m.vertices.contains(&(v as u32)) {
                let c = m.columns(&s.position);
                println!("     membrane {k} {:?} strain {:.4} {:.4} sine {:.3} density {:.3} {:.3}", m.vertices.map(|w| (w, s.fixed.contains(w as usize))), strain[ny+2*k], strain[ny+2*k+1], c[0].dot(&c[1])/c[0].norm()/c[1].norm(), s.force_density[ny+2*k], s.force_density[ny+2*k+1]);
            }}
            let mut e = 0;
            for y in &lam.yarns { for w in y.vertices.windows(2) { if w.contains(&(v as u32)) { println!("     yarn {:?} strain {:.4} density {:.3} width {:.2e}", w, strain[e], s.force_density[e], y.width); } e += 1; } }
            }
        }
    }
}
fn pick(d: &Draping, stream: &mut Stream) -> u32 {
    let n = d.shape().pixel_count() as u32;
    let ok: Vec<u32> = (0..n).filter(|&a| d.allows(0, a)).collect();
    ok[stream.below(ok.len())]
}
