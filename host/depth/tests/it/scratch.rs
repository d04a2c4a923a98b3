//! not committed
use farnear_depth::{adaptive_window::Window, calibrate::stack::*, measure::*, pipeline::Settings};
use ndarray::{Array2, s};
#[test]
#[ignore]
fn plate() {
    let slices: Vec<Array2<f32>> = (1..=16).map(|i| {
        let b = std::fs::read(format!("/tmp/e2e/{i:02}.f32")).unwrap();
        let v: Vec<f32> = b.chunks(4).map(|c| f32::from_le_bytes(c.try_into().unwrap())).collect();
        Array2::from_shape_vec((384, 464), v).unwrap()
    }).collect();
    for (bin, step, peer) in [(1,2,0.0089),(1,3,0.0105),(2,4,0.0122),(2,6,0.0184),(2,5,0.015)] {
        let left: Vec<_> = slices.iter().map(|s| s.slice(s![.., ..232]).to_owned()).collect();
        let t = std::time::Instant::now();
        let lens = calibrate_stack(&left, &StackSettings{step_mm:0.1,pixel_um:6.9,far_mm:None,pair_step:Some(step),bin:Some(bin)}).unwrap();
        let o=&lens.optics; let st=o.stage().unwrap();
        println!("{bin} {step}: {:?} {} blur {:.2} floor {} residual {:.4} usual {:.2e}\n  measured {:.2?} response {:.2?}..{:.2?} {:?}", lens.held_out, o.psf(), o.max_blur_px(), st.blur_floor_px, st.residual, st.usual_unexplained, st.measured, st.response[0], st.response[16], t.elapsed());
        let settings = MeasureSettings{window:Window::Adaptive,run:Settings{median_px:3,..Settings::default()},..MeasureSettings::default()};
        let (h,w)=(384/bin,464/bin);
        let mut errs=vec![]; let mut total=0; let mut sq=0.0; let mut within=0;
        let mut table=vec![];
        for i in 1..=16-step {
            let focus=|y:usize,x:usize| {let f=|i:usize|(i*bin) as f64+(bin-1) as f64/2.0; 9.5452e-05*f(x)+0.000_522_74*f(y)+8.317557};
            let alpha=|y:usize,x:usize| -1.0+2.0*(focus(y,x)-i as f64)/step as f64;
            if alpha(h/2,w/2).abs()>1.0 {continue;}
            let m=measure_pair([slices[i-1].clone(),slices[i-1+step].clone()],o,DepthMethod::Whitened,None,&settings).unwrap();
            for y in 8..h-8 { for x in w/2..w-8 { total+=1;
                let d=m.map.depth_mm[(y,x)]; if !d.is_finite(){continue;}
                let e=f64::from(d)-(o.working_range().far_mm-(1.0+alpha(y,x))*0.05*step as f64);
                let sd=f64::from(m.validity.deviation_mm[(y,x)]);
                errs.push(e.abs()); sq+=(e/sd).powi(2); within+=usize::from(e.abs()<3.0*sd);
                table.push((f64::from(m.map.confidence[(y,x)]),e,sd));
            }}
        }
        let n=errs.len(); errs.sort_by(f64::total_cmp);
        let rms=(errs.iter().map(|e|e*e).sum::<f64>()/n as f64).sqrt();
        println!("  JUDGED robust {:.4} ({:.2} of peer) rms {rms:.4} fill {:.3} within3 {:.3} scatter {:.2}",1.4826*errs[n/2],1.4826*errs[n/2]/peer,n as f64/total as f64,within as f64/n as f64,(sq/n as f64).sqrt());
        table.sort_by(|a,b|a.2.total_cmp(&b.2));
        for c in table.chunks(n/6+1) { let k=c.len() as f64; print!("  [sd {:.4} rms {:.4} within {:.3}]",c.iter().map(|t|t.2).sum::<f64>()/k,(c.iter().map(|t|t.1*t.1).sum::<f64>()/k).sqrt(),c.iter().filter(|t|t.1.abs()<3.0*t.2).count() as f64/k);}
        println!();
    }
}
